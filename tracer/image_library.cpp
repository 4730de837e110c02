#include "tracer/image_library.h"

#include <dlfcn.h>

#include <filesystem>

#include "accel/base/error.h"

namespace raybench {
namespace {

namespace fs = std::filesystem;

/// Where it was installed, else in the build folder.
fs::path ImageLibraryFile() {
  const fs::path program = fs::read_symlink("/proc/self/exe").parent_path();
  for (const char* folder : {RAYBENCH_INSTALLED_LIBRARIES, "lib", "../lib"}) {
    const fs::path file = program / folder / "libraybench_images.so";
    if (fs::exists(file)) return file;
  }
  throw InputError((program / RAYBENCH_INSTALLED_LIBRARIES).lexically_normal().string() +
                   ": pictures need libraybench_images.so, which is not there");
}

}  // namespace

const ImageLibrary& LoadImageLibrary() {
  static const ImageLibrary& library = []() -> const ImageLibrary& {
    void* const file = dlopen(ImageLibraryFile().c_str(), RTLD_NOW | RTLD_LOCAL);
    void* const entry = file ? dlsym(file, "RaybenchImageLibrary") : nullptr;
    if (entry == nullptr)
      throw InputError(std::string("pictures need a library of raybench's: ") + dlerror());
    return *reinterpret_cast<const ImageLibrary* (*)()>(entry)();
  }();
  return library;
}

}  // namespace raybench
