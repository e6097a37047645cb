#include "sim/scene/located_json.h"

#include <algorithm>
#include <charconv>
#include <iterator>

#include "sim/core/error.h"

namespace rhytid {
namespace {

using nlohmann::json;
constexpr size_t max_depth = 64;

/// Input iterator that leaves the position of the parser visible from outside.
struct CountingIterator {
  using iterator_category = std::input_iterator_tag;
  using value_type = char;
  using difference_type = std::ptrdiff_t;
  using pointer = const char*;
  using reference = const char&;

  const char* at = nullptr;
  const char** position = nullptr;

  const char& operator*() const { return *at; }
  CountingIterator& operator++() {
    *position = ++at;
    return *this;
  }
  CountingIterator operator++(int) {
    CountingIterator old = *this;
    ++*this;
    return old;
  }
  friend bool operator==(const CountingIterator& a, const CountingIterator& b) { return a.at == b.at; }
  friend bool operator!=(const CountingIterator& a, const CountingIterator& b) { return a.at != b.at; }
};

/// At most `size` bytes, not cut inside a character.
std::string shortened(const std::string& text, size_t size) {
  if (text.size() <= size) return text;
  size_t end = size - 3;
  while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0) == 0x80) --end;
  return text.substr(0, end) + "...";
}

/// SAX handler that builds the document and notes the line of every value.
class Builder {
 public:
  Builder(std::string_view text, const std::string& file)
      : text_(text), file_(file), position_(text.data()) {}

  LocatedJson run() {
    const char* end = text_.data() + text_.size();
    json::sax_parse(CountingIterator{text_.data(), &position_}, CountingIterator{end, &position_}, this,
                    nlohmann::detail::input_format_t::json, true, true);
    return std::move(result_);
  }

  bool null() { return add(nullptr); }
  bool boolean(bool value) { return add(value); }
  bool number_integer(json::number_integer_t value) { return add(value); }
  bool number_unsigned(json::number_unsigned_t value) { return add(value); }
  bool number_float(json::number_float_t value, const json::string_t&) { return add(value); }
  bool string(json::string_t& value) { return add(std::move(value)); }
  bool binary(json::binary_t&) { return false; }
  bool start_object(size_t) { return open(json::object()); }
  bool start_array(size_t) { return open(json::array()); }
  bool end_object() { return close(); }
  bool end_array() { return close(); }
  bool key(json::string_t& key) {
    if (frames_.back().value->contains(key))
      throw InputError(place(), "the key " + shown_json(key) + " twice", "each key once");
    frames_.back().key = std::move(key);
    return true;
  }
  /// The library's message without its prefix and its own idea of the place.
  bool parse_error(size_t byte, const std::string& token, const nlohmann::detail::exception& error) {
    std::string message = error.what();
    const size_t column = message.find(", column ");
    const size_t start = message.find(": ", column == std::string::npos ? 0 : column);
    if (start != std::string::npos)
      message = message.substr(start + 2);
    else if (const size_t bracket = message.find("] "); bracket != std::string::npos)
      message = message.substr(bracket + 2);
    std::replace(message.begin(), message.end(), '\n', ' ');
    // The library forgets that a comma would do as well.
    for (const char* bracket : {"expected '}'", "expected ']'"})
      if (const std::string word = bracket; message.ends_with(word))
        message.replace(message.size() - word.size(), word.size(), "expected ',' or " + word.substr(9));
    size_t index = std::min(byte > 0 ? byte - 1 : 0, text_.size());
    // Point to the beginning of the word that was not expected rather than to its end.
    if (!token.empty() && token.size() <= byte && byte <= text_.size() &&
        text_.substr(byte - token.size(), token.size()) == token)
      index = byte - token.size();
    const std::string_view before = text_.substr(0, index);
    const size_t newline = before.rfind('\n');
    const size_t in_line = newline == std::string_view::npos ? index : index - newline - 1;
    throw InputError(file_ + ":" + std::to_string(1 + std::count(before.begin(), before.end(), '\n')) + ":" +
                     std::to_string(in_line + 1) + ": " + message);
  }

 private:
  struct Frame {
    json* value;
    std::string pointer;
    std::string key;
  };

  std::string place() {
    // The lexer has read one character beyond a number; that one may be the end of the line.
    const char* end = std::max(position_ - 1, counted_to_);
    line_ += std::count(counted_to_, end, '\n');
    counted_to_ = end;
    return file_ + ":" + std::to_string(line_);
  }

  json* append(json value, std::string& pointer) {
    json* slot = &result_.json;
    if (!frames_.empty()) {
      Frame& frame = frames_.back();
      if (frame.value->is_array()) {
        pointer = frame.pointer + "/" + std::to_string(frame.value->size());
        frame.value->push_back(nullptr);
        slot = &frame.value->back();
      } else {
        pointer = frame.pointer + "/" + escape_key(frame.key);
        slot = &(*frame.value)[frame.key];
      }
    }
    *slot = std::move(value);
    result_.origin[pointer] = place();
    return slot;
  }
  bool add(json value) {
    std::string pointer;
    append(std::move(value), pointer);
    return true;
  }
  bool open(json container) {
    if (frames_.size() >= max_depth)
      throw InputError(place(), "brackets nested more than " + std::to_string(max_depth) + " deep",
                       "a scene");
    std::string pointer;
    json* slot = append(std::move(container), pointer);
    frames_.push_back({slot, std::move(pointer), {}});
    return true;
  }
  bool close() {
    frames_.pop_back();
    return true;
  }

  std::string_view text_;
  std::string file_;
  const char* position_;
  const char* counted_to_ = text_.data();
  std::ptrdiff_t line_ = 1;
  LocatedJson result_;
  std::vector<Frame> frames_;
};

}  // namespace

std::string LocatedJson::where(std::string pointer) const {
  for (;;) {
    if (const auto found = origin.find(pointer); found != origin.end()) return found->second;
    if (pointer.empty()) return "";
    pointer.erase(pointer.rfind('/'));
  }
}

std::string escape_key(std::string_view key) {
  std::string escaped;
  for (char c : key) {
    if (c == '~')
      escaped += "~0";
    else if (c == '/')
      escaped += "~1";
    else
      escaped += c;
  }
  return escaped;
}

std::vector<std::string> split_pointer(std::string_view pointer, const std::string& where) {
  if (pointer.empty()) return {};
  if (pointer.front() != '/')
    throw InputError(where, shown_json(std::string(pointer)),
                     "a JSON pointer such as /skin/layers/film/thickness");
  std::vector<std::string> keys;
  for (size_t i = 0; i < pointer.size(); ++i) {
    if (pointer[i] == '/') {
      keys.emplace_back();
    } else if (pointer[i] == '~' && i + 1 < pointer.size() &&
               (pointer[i + 1] == '0' || pointer[i + 1] == '1')) {
      keys.back() += pointer[++i] == '0' ? '~' : '/';
    } else {
      keys.back() += pointer[i];
    }
  }
  return keys;
}

std::string shown_text(const std::string& text) {
  const std::string quoted = json(text).dump(-1, ' ', false, json::error_handler_t::replace);
  return shortened(quoted.substr(1, quoted.size() - 2), 200);
}

std::string shown_json(const json& value) {
  return shortened(value.dump(-1, ' ', false, json::error_handler_t::replace), 60);
}

int find_named(const json& list, std::string_view name) {
  for (size_t i = 0; i < list.size(); ++i)
    if (list[i].is_object() && list[i].contains("name") && list[i]["name"].is_string() &&
        list[i]["name"].get_ref<const std::string&>() == name)
      return static_cast<int>(i);
  return -1;
}

LocatedJson parse_located(std::string_view text, const std::string& file) {
  return Builder(text, file).run();
}

}  // namespace rhytid
