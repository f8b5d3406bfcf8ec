// A library that calls into one that is not there when the program runs.
extern "C" int plainAnswer();

extern "C" __attribute__((visibility("default"))) int brokenAnswer() {
  return plainAnswer();
}
