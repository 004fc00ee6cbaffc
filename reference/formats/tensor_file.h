// Tensor files: named arrays behind one header, as the RGL material database stores its measurements.
//
//   "tensor_file\0", u8 1, u8 0, u32 fields; per field u16 length, name, u16 dimensions, u8 type, u64 offset,
//   u64 shape[]; then the arrays, each at a multiple of 8 bytes. Little-endian.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace lobefit {

struct Tensor {
  enum Type : std::uint8_t { u8 = 1, i8, u16, i16, u32, i32, u64, i64, f16, f32, f64 };

  std::string name;
  Type type = f32;
  std::vector<std::uint64_t> shape;
  std::string bytes;
  std::uint64_t offset = 0;  // in the file it was read from

  /// Elements of an array of 32-bit floats.
  std::vector<float> floats() const;
  static Tensor of_floats(std::string name, std::vector<std::uint64_t> shape, const std::vector<float>& values);
  static Tensor of_text(std::string name, std::string_view text);
};

struct TensorFile {
  std::vector<Tensor> fields;  // in the file's order

  /// Throws Error(invalid_input) with the byte that is wrong; allocates no more than the file holds.
  static TensorFile parse(std::string_view bytes, const std::string& place);
  /// The same bytes that were parsed, where the file was laid out as above.
  std::string serialise() const;
  const Tensor* find(std::string_view name) const;
};

}  // namespace lobefit
