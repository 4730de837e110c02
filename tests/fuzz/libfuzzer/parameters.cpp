// Parameters on bytes, of structures, generators and modifiers: one line says what is wrong, or their text reads back.
#include "accel/host/parameters.h"

#include "accel/host/registry.h"
#include "datasets/scene/scene.h"
#include "tests/fuzz/libfuzzer/target.h"

namespace raybench::fuzz {
namespace {

void ReadsBack(std::string_view owner, std::span<const rb_param> params, size_t size, const Spec& spec) {
  const auto config = Configure(owner, params, size, spec.values);
  const std::string all = FormatAllParameters(params, config.data());
  for (const std::string& text :
       {FormatSpec(owner, params, config.data()), fmt::format("{}({})", owner, all)}) {
    if (text.ends_with("()")) continue;
    const auto again = Configure(owner, params, size, ParseSpec(text).values);
    Demand(FormatAllParameters(params, again.data()) == all,
           "text of parameters reads back otherwise: " + text);
  }
}

template <class Described>
void TryAll(const std::vector<const Described*>& all, const Spec& spec) {
  for (const Described* d : all)
    if (spec.name == d->name) ReadsBack(d->name, std::span(d->params, d->param_count), d->config_size, spec);
}

}  // namespace
}  // namespace raybench::fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace raybench;
  using namespace raybench::fuzz;
  static const Registry registry;
  try {
    for (const std::string& item : SplitSpecs(Bytes(data, size))) {
      const Spec spec = ParseSpec(item);
      TryAll(Generators(), spec), TryAll(Modifiers(), spec);
      for (const rb_structure* s : registry.structures())
        if (spec.name == s->name)
          ReadsBack(s->name, std::span(s->params, s->param_count), s->config_size, spec);
    }
  } catch (const InputError& error) {
    DemandOneLine(error.what(), "");
  }
  return 0;
}
