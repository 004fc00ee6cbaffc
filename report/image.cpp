#include "report/image.h"

#include <dlfcn.h>

#include <cmath>
#include <string>

#include "models/error.h"
#include "reference/output_file.h"
#include "report/image_module.h"

namespace lobefit {

namespace {

/// A function of the module, which stays open.
template <class Function>
Function* module_function(const char* symbol, const std::string& place) {
  void* module = dlopen(image_module_name, RTLD_NOW | RTLD_LOCAL);
  if (!module) {
    const std::string reason = dlerror();
    throw Error(ExitCode::missing_part, "can't open the picture module: " + reason, place,
                "install libopenimageio2.4, and keep " + std::string(image_module_name) + " beside the program");
  }
  const auto function = reinterpret_cast<Function*>(dlsym(module, symbol));
  if (!function) {
    throw Error(ExitCode::missing_part, "the picture module is of another version", image_module_name,
                "build lobefit again");
  }
  return function;
}

void check(bool written, const std::string& failure, const std::filesystem::path& path) {
  if (!written) throw Error(ExitCode::failure, failure, path.string(), "check the free space on the disk");
}

}  // namespace

void write_false_colour(std::span<const float> values, std::size_t width, std::size_t height,
                        const std::filesystem::path& path, bool overwrite) {
  OutputFile file(path, overwrite);
  std::string failure;
  check(module_function<WriteFalseColour>(write_false_colour_symbol, path.string())(values, width, height,
                                                                                    file.temporary(), failure),
        failure, path);
  file.commit();
}

void check_picture_extension(const std::filesystem::path& path) {
  if (path.extension() == ".png" || path.extension() == ".exr") return;
  throw Error(ExitCode::usage, "no picture format has the extension '" + path.extension().string() + "'", path.string(),
              "use .png or .exr");
}

void write_picture(const SphereImage& image, double exposure, const std::filesystem::path& path, bool overwrite) {
  check_picture_extension(path);
  OutputFile file(path, overwrite);
  const auto scale = static_cast<float>(std::exp2(exposure));
  std::vector<float> rgba(4 * image.pixels());
  for (std::size_t pixel = 0; pixel < image.pixels(); ++pixel) {
    for (std::size_t c = 0; c < 3; ++c) rgba[4 * pixel + c] = scale * image.rgb[3 * pixel + c];
    rgba[4 * pixel + 3] = image.cover[pixel];
  }
  std::string failure;
  check(module_function<WritePicture>(write_picture_symbol, path.string())(
            rgba, static_cast<std::size_t>(image.size), path.extension() == ".png", file.temporary(), failure),
        failure, path);
  file.commit();
}

LinearPicture read_picture(const std::filesystem::path& path) {
  LinearPicture picture;
  std::string failure;
  if (!module_function<ReadPicture>(read_picture_symbol, path.string())(path, picture.rgb, picture.width,
                                                                        picture.height, failure)) {
    throw Error(ExitCode::invalid_input, failure, path.string(),
                "use a picture file that OpenImageIO reads, .exr or .hdr say");
  }
  return picture;
}

}  // namespace lobefit
