#include "report/image.h"

#include <dlfcn.h>

#include <string>

#include "models/error.h"
#include "reference/output_file.h"
#include "report/image_module.h"

namespace lobefit {

void write_false_colour(std::span<const float> values, std::size_t width, std::size_t height,
                        const std::filesystem::path& path, bool overwrite) {
  OutputFile file(path, overwrite);
  void* module = dlopen(image_module_name, RTLD_NOW | RTLD_LOCAL);
  if (!module) {
    const std::string reason = dlerror();
    throw Error(ExitCode::missing_part, "can't open the picture module: " + reason, path.string(),
                "install libopenimageio2.4, and keep " + std::string(image_module_name) + " beside the program");
  }
  const auto write = reinterpret_cast<WriteFalseColour*>(dlsym(module, write_false_colour_symbol));
  if (!write) {
    throw Error(ExitCode::missing_part, "the picture module is of another version", image_module_name,
                "build lobefit again");
  }
  std::string failure;
  if (!write(values, width, height, file.temporary(), failure)) {
    throw Error(ExitCode::failure, failure, path.string(), "check the free space on the disk");
  }
  file.commit();
}

}  // namespace lobefit
