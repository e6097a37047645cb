// A strict look at a page of HTML: every element closed in order, attributes quoted, text escaped, nothing
// from outside. Stricter than HTML itself, which is what a page made by one writer can keep.
#pragma once

#include <cctype>
#include <set>
#include <string>
#include <vector>

namespace rhytid::test {

/// The first complaint, or an empty text.
inline std::string html_complaint(const std::string& page) {
  const std::set<std::string> empty_elements = {"meta", "img", "br", "hr", "input"};
  std::vector<std::string> open;
  const auto context = [&page](size_t at) { return " near '" + page.substr(at, 60) + "'"; };
  size_t at = 0;
  const std::string doctype = "<!DOCTYPE html>";
  if (page.compare(0, doctype.size(), doctype) != 0) return "no doctype";
  at = doctype.size();
  while (at < page.size()) {
    if (page[at] == '>') return "a bare >" + context(at);
    if (page[at] == '&') {
      const size_t end = page.find(';', at);
      if (end == std::string::npos || end - at > 8) return "a bare &" + context(at);
    }
    if (page[at] != '<') {
      ++at;
      continue;
    }
    const bool closing = page[at + 1] == '/';
    size_t i = at + (closing ? 2 : 1);
    std::string name;
    while (i < page.size() && (std::isalnum(static_cast<unsigned char>(page[i])) || page[i] == '-'))
      name += page[i++];
    if (name.empty()) return "a bare <" + context(at);
    if (closing) {
      if (open.empty() || open.back() != name) return "</" + name + "> closes nothing" + context(at);
      open.pop_back();
      if (page[i] != '>') return "a closing tag with more than its name" + context(at);
      at = i + 1;
      continue;
    }
    if (name == "script" || name == "link" || name == "iframe" || name == "object") return name + " element";
    std::set<std::string> attributes;
    for (;;) {
      while (std::isspace(static_cast<unsigned char>(page[i]))) ++i;
      if (page[i] == '>' || page[i] == '/') break;
      std::string attribute;
      while (i < page.size() &&
             (std::isalnum(static_cast<unsigned char>(page[i])) || page[i] == '-' || page[i] == ':'))
        attribute += page[i++];
      if (attribute.empty() || page[i] != '=' || page[i + 1] != '"')
        return "an attribute without quotes" + context(at);
      const size_t end = page.find('"', i + 2);
      const std::string value = page.substr(i + 2, end - i - 2);
      if (value.find('<') != std::string::npos) return "a < in an attribute" + context(at);
      if (!attributes.insert(attribute).second) return "an attribute twice: " + attribute + context(at);
      if (attribute == "src" && value.compare(0, 11, "data:image/") != 0)
        return "a src that is not data" + context(at);
      if (attribute == "href" && value.compare(0, 1, "#") != 0) return "a link out of the page" + context(at);
      if (attribute.compare(0, 2, "on") == 0) return "an event handler" + context(at);
      i = end + 1;
    }
    if (name == "img" && !attributes.count("alt")) return "an img without alt" + context(at);
    if (page[i] == '/') {
      ++i;
    } else if (!empty_elements.count(name)) {
      open.push_back(name);
    }
    if (page[i] != '>') return "a tag that does not end" + context(at);
    at = i + 1;
    if (name == "style") {  // raw text
      const size_t end = page.find("</style>", at);
      const std::string css = page.substr(at, end - at);
      if (css.find("url(") != std::string::npos || css.find("@import") != std::string::npos)
        return "css loads a file";
      at = end;
    }
  }
  return open.empty() ? "" : "<" + open.back() + "> is never closed";
}

}  // namespace rhytid::test
