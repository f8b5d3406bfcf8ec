// A library with one function.
extern "C" __attribute__((visibility("default"))) int plainAnswer() {
  return 42;
}
