#include "sim/output/vtk_xml.h"

#include <zlib.h>

#include <algorithm>
#include <bit>
#include <cstring>

#include "sim/core/error.h"
#include "sim/output/text.h"

namespace rhytid {

namespace {

static_assert(std::endian::native == std::endian::little, "the VTK header says LittleEndian");

constexpr size_t block_size = 1 << 18;

void append_u64(std::string& out, std::uint64_t value) {
  out.append(reinterpret_cast<const char*>(&value), sizeof value);
}

/// [number of blocks, block size, size of a partial last block, compressed sizes...] then the blocks.
std::string compressed(const void* data, size_t bytes) {
  const auto* source = static_cast<const Bytef*>(data);
  const size_t blocks = (bytes + block_size - 1) / block_size;
  std::string header, body;
  append_u64(header, blocks);
  append_u64(header, block_size);
  append_u64(header, bytes % block_size);
  std::vector<Bytef> buffer(compressBound(block_size));
  for (size_t b = 0; b < blocks; ++b) {
    const size_t begin = b * block_size, size = std::min(block_size, bytes - begin);
    uLongf written = buffer.size();
    const int status = compress2(buffer.data(), &written, source + begin, size, 4);
    require(status == Z_OK, "zlib compression failed");
    append_u64(header, written);
    body.append(reinterpret_cast<const char*>(buffer.data()), written);
  }
  return header + body;
}

}  // namespace

VtkXml::VtkXml(const std::string& type) {
  text_ = "<?xml version=\"1.0\"?>\n";
  open("VTKFile", "type=\"" + type +
                      "\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\" "
                      "compressor=\"vtkZLibDataCompressor\"");
  open(type);
}

void VtkXml::open(const std::string& tag, const std::string& attributes) {
  text_ += std::string(2 * open_tags_.size(), ' ') + "<" + tag + (attributes.empty() ? "" : " ") +
           attributes + ">\n";
  open_tags_.push_back(tag);
}

void VtkXml::close() {
  const std::string tag = open_tags_.back();
  open_tags_.pop_back();
  text_ += std::string(2 * open_tags_.size(), ' ') + "</" + tag + ">\n";
}

void VtkXml::raw_array(const char* type, const std::string& name, int components, const void* data,
                       size_t bytes) {
  text_ += std::string(2 * open_tags_.size(), ' ') + "<DataArray type=\"" + type + "\" Name=\"" +
           xml_escaped(name) + "\" NumberOfComponents=\"" + std::to_string(components) +
           "\" format=\"appended\" offset=\"" + std::to_string(appended_.size()) + "\"/>\n";
  appended_ += compressed(data, bytes);
}

void VtkXml::array(const std::string& name, int components, const std::vector<double>& values) {
  raw_array("Float64", name, components, values.data(), values.size() * sizeof values[0]);
}
void VtkXml::array(const std::string& name, int components, const std::vector<std::int64_t>& values) {
  raw_array("Int64", name, components, values.data(), values.size() * sizeof values[0]);
}
void VtkXml::array(const std::string& name, int components, const std::vector<std::int32_t>& values) {
  raw_array("Int32", name, components, values.data(), values.size() * sizeof values[0]);
}
void VtkXml::array(const std::string& name, int components, const std::vector<std::uint8_t>& values) {
  raw_array("UInt8", name, components, values.data(), values.size() * sizeof values[0]);
}

void VtkXml::time_value(double time) {
  open("FieldData");
  text_ += std::string(2 * open_tags_.size(), ' ') +
           "<DataArray type=\"Float64\" Name=\"TimeValue\" NumberOfTuples=\"1\" format=\"ascii\">" +
           exact_text(time) + "</DataArray>\n";
  close();
}

std::string VtkXml::finish() {
  while (open_tags_.size() > 1) close();
  text_ += "  <AppendedData encoding=\"raw\">\n_" + appended_ + "\n  </AppendedData>\n";
  close();
  return std::move(text_);
}

}  // namespace rhytid
