// The container of VTK XML files (.vtu, .vtp): typed arrays, zlib-compressed, in one appended raw section.
// Format: VTK file formats, "XML File Formats"; vtkZLibDataCompressor blocks with UInt64 headers.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace rhytid {

/// Builds the XML text in order of calls and the appended bytes beside it. Used by vtu.cpp and vtp.cpp only.
class VtkXml {
 public:
  /// `type` is "UnstructuredGrid" or "PolyData".
  explicit VtkXml(const std::string& type);
  /// Opens <tag attributes>; close() closes the innermost open tag.
  void open(const std::string& tag, const std::string& attributes = {});
  void close();
  /// A data array; `values` holds whole tuples of `components`.
  void array(const std::string& name, int components, const std::vector<double>& values);
  void array(const std::string& name, int components, const std::vector<std::int64_t>& values);
  void array(const std::string& name, int components, const std::vector<std::int32_t>& values);
  void array(const std::string& name, int components, const std::vector<std::uint8_t>& values);
  /// A FieldData element with the physical time, s, which ParaView shows.
  void time_value(double time);
  /// Closes everything and returns the bytes of the file.
  std::string finish();

 private:
  void raw_array(const char* type, const std::string& name, int components, const void* data, size_t bytes);

  std::string text_, appended_;
  std::vector<std::string> open_tags_;
};

}  // namespace rhytid
