// Connects, makes a floor, prints the first object that is touched.
#include <hapticd/client.h>

#include <cstdio>

int main(int, char** argv) try {
  const std::vector<std::array<float, 3>> floor{
      {-80, -10, -40}, {-80, -10, 40}, {80, -10, 40}, {80, -10, -40}};
  const std::vector<std::array<std::uint32_t, 3>> triangles{{0, 1, 2}, {0, 2, 3}};
  hapticd::Client client(argv[1]);
  client.setSurface(0, {.stiffness = 0.8F});
  client.uploadMesh(0, {floor, triangles});
  while (client.latest().touchedObject.object < 0) client.poll(std::chrono::seconds(1));
  std::printf("felt object %d\n", client.latest().touchedObject.object);
} catch (const hapticd::Error& error) {
  std::printf("%s\n", error.what());
  return 1;
}
