// Case files on bytes: one line says what is wrong, or the case is written and read back to the same text.
#include "harness/fuzz/case.h"

#include "tests/fuzz/libfuzzer/target.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace raybench;
  using namespace raybench::fuzz;
  try {
    const Case c = ParseCase(Bytes(data, size), "input.case");
    const std::string text = Format(c);
    Demand(Format(ParseCase(text, "input.case")) == text, "a case reads back otherwise:\n" + text);
    const Scene scene = SceneOf(c);
    Demand(scene.primitive_count() == c.primitives(), "primitives were left out");
  } catch (const InputError& error) {
    DemandOneLine(error.what(), "");
  }
  return 0;
}
