// A program of VRPN's classes, as published with the University of Malaga's server for haptic devices
// (figure 8): it compiles against VRPN with that extension, or against hapticd (pkg-config hapticd-vrpn).
//   paper_figure8 [NAME@host] [seconds]
#include <vrpn_Connection.h>
#include <vrpn_ForceDevice.h>

#include <cstdio>
#include <cstdlib>

static int forces = 0;

void VRPN_CALLBACK handleForce(void* userdata, const vrpn_FORCECB f) {
  if (++forces % 500 == 1) {
    printf("%s: force %6.3f %6.3f %6.3f N\n", static_cast<const char*>(userdata), f.force[0], f.force[1],
           f.force[2]);
  }
}

void VRPN_CALLBACK handleTouched(void*, const vrpn_TOUCHEDOBJECTCB o) {
  printf("object %d is touched\n", o.ObjectNum);
}

int main(int argc, char* argv[]) {
  const char* name = argc > 1 ? argv[1] : "Phantom@localhost";
  const double seconds = argc > 2 ? atof(argv[2]) : 10;

  vrpn_ForceDevice_Remote* device = new vrpn_ForceDevice_Remote(name);
  vrpn_Connection* connection = device->connectionPtr();
  static char who[] = "device";
  device->register_force_change_handler(who, handleForce);
  device->register_touchedObject_handler(NULL, handleTouched);

  for (int i = 0; i < 500 && !connection->connected(); ++i) {
    device->mainloop();
    vrpn_SleepMsecs(10);
  }
  if (!connection->connected()) {
    fprintf(stderr, "paper_figure8: no server answers as %s\n", name);
    return 1;
  }

  device->resetScene();
  device->setObjectNumber(1);
  const float floor[6][3] = {{-80, -10, -40}, {-80, -10, 40}, {80, -10, 40},
                             {-80, -10, -40}, {80, -10, 40},  {80, -10, -40}};
  for (int i = 0; i < 6; ++i) device->setObjectVertex(0, i, floor[i][0], floor[i][1], floor[i][2]);
  vrpn_float64 identity[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  device->setTransformMatrix(0, identity);
  device->setHapticProperty(0, "stiffness", 0.8f);
  device->setHapticProperty(0, "damping", 0.1f);
  device->setHapticProperty(0, "static friction", 0.3f);
  device->setHapticProperty(0, "dynamic friction", 0.2f);
  device->setTouchableFace(2);
  device->setObjectIsTouchable(0, true);

  timeval start, now;
  vrpn_gettimeofday(&start, NULL);
  do {
    device->mainloop();
    vrpn_SleepMsecs(1);
    vrpn_gettimeofday(&now, NULL);
  } while (vrpn_TimevalDurationSeconds(now, start) < seconds && connection->doing_okay());

  printf("%d force reports\n", forces);
  delete device;
  return forces > 0 ? 0 : 1;
}
