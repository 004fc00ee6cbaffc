#include "reference/formats/tensor_file.h"

#include <algorithm>
#include <array>

#include "reference/formats/byte_reader.h"

namespace lobefit {

namespace {

constexpr std::string_view magic("tensor_file\0\1\0", 14);
constexpr std::array<std::uint64_t, 12> type_sizes{0, 1, 1, 2, 2, 4, 4, 8, 8, 2, 4, 8};
constexpr std::size_t alignment = 8;

template <class T>
void append(std::string& bytes, T value) {
  std::array<char, sizeof(T)> raw;
  std::memcpy(raw.data(), &value, sizeof(T));
  bytes.append(raw.data(), raw.size());
}

}  // namespace

std::vector<float> Tensor::floats() const {
  std::vector<float> values(bytes.size() / sizeof(float));
  std::memcpy(values.data(), bytes.data(), values.size() * sizeof(float));
  return values;
}

Tensor Tensor::of_floats(std::string name, std::vector<std::uint64_t> shape, const std::vector<float>& values) {
  return {std::move(name), f32, std::move(shape),
          std::string(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(float))};
}

Tensor Tensor::of_text(std::string name, std::string_view text) {
  return {std::move(name), u8, {text.size()}, std::string(text)};
}

TensorFile TensorFile::parse(std::string_view bytes, const std::string& place) {
  ByteReader reader(bytes, place);
  if (reader.take(magic.size(), "the header") != magic) {
    throw reader.error("not a tensor file of version 1.0", 0);
  }
  const auto count = reader.number<std::uint32_t>("the number of fields");
  TensorFile result;
  std::uint64_t total = 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::size_t start = reader.offset();
    Tensor field;
    field.name = reader.take(reader.number<std::uint16_t>("a name's length"), "a name");
    if (field.name.empty() || std::any_of(field.name.begin(), field.name.end(), [](char c) {
          return static_cast<unsigned char>(c) <= 0x20 || static_cast<unsigned char>(c) >= 0x7f;
        })) {
      throw reader.error("a field's name is empty or has strange characters", start);
    }
    if (result.find(field.name)) throw reader.error("two fields are named '" + field.name + "'", start);
    const auto dimensions = reader.number<std::uint16_t>("the dimensions");
    const auto type = reader.number<std::uint8_t>("the type");
    if (type == 0 || type >= type_sizes.size()) {
      throw reader.error("field '" + field.name + "' has the unknown type " + std::to_string(type), start);
    }
    field.type = static_cast<Tensor::Type>(type);
    const auto offset = reader.number<std::uint64_t>("an offset");
    std::uint64_t size = type_sizes[type];
    for (std::uint16_t d = 0; d < dimensions; ++d) {
      const auto extent = reader.number<std::uint64_t>("a shape");
      if (extent == 0) throw reader.error("field '" + field.name + "' has an axis of size 0", start);
      if (extent > bytes.size() / size) {
        throw reader.error("field '" + field.name + "' is larger than the file: truncated, or its shape is wrong",
                           start);
      }
      size *= extent;
      field.shape.push_back(extent);
    }
    // Overlapping fields could multiply a small file.
    total += size;
    if (total > bytes.size()) throw reader.error("the fields are larger than the file: truncated", start);
    const std::size_t next = reader.offset();
    if (offset > bytes.size()) throw reader.error("field '" + field.name + "' lies behind the file's end", start);
    reader.seek(offset);
    field.offset = offset;
    field.bytes = reader.take(size, ("field '" + field.name + "'").c_str());
    reader.seek(next);
    result.fields.push_back(std::move(field));
  }
  return result;
}

std::string TensorFile::serialise() const {
  const auto aligned = [](std::size_t offset) { return (offset + alignment - 1) / alignment * alignment; };
  std::size_t offset = magic.size() + 4;
  for (const Tensor& field : fields) offset += 2 + field.name.size() + 2 + 1 + 8 + 8 * field.shape.size();
  std::string bytes(magic);
  append(bytes, static_cast<std::uint32_t>(fields.size()));
  for (const Tensor& field : fields) {
    offset = aligned(offset);
    append(bytes, static_cast<std::uint16_t>(field.name.size()));
    bytes += field.name;
    append(bytes, static_cast<std::uint16_t>(field.shape.size()));
    append(bytes, static_cast<std::uint8_t>(field.type));
    append(bytes, static_cast<std::uint64_t>(offset));
    for (const std::uint64_t extent : field.shape) append(bytes, extent);
    offset += field.bytes.size();
  }
  for (const Tensor& field : fields) {
    bytes.resize(aligned(bytes.size()), '\0');
    bytes += field.bytes;
  }
  return bytes;
}

const Tensor* TensorFile::find(std::string_view name) const {
  const auto found = std::find_if(fields.begin(), fields.end(), [&](const Tensor& t) { return t.name == name; });
  return found == fields.end() ? nullptr : &*found;
}

}  // namespace lobefit
