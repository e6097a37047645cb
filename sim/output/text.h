// Numbers and bytes as text, independent of the locale.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace rhytid {

/// The shortest decimal text that reads back as exactly the same double ("nan", "inf", "-inf" included).
std::string exact_text(double value);

/// Text with `digits` significant digits, trailing zeros dropped, for people to read.
std::string short_text(double value, int digits = 4);

/// Text with `decimals` digits after the point.
std::string fixed_text(double value, int decimals);

/// "3 frames", "1 frame": the count with its noun in the right number.
std::string counted(long count, const std::string& noun);

/// Escapes & < > " ' for XML, SVG and HTML.
std::string xml_escaped(std::string_view text);

/// Base64 (RFC 4648, padded), e.g. to put a PNG into a self-contained HTML page.
std::string base64(std::string_view bytes);

/// Round numbers (1, 2 or 5 times a power of ten apart) covering [low, high], about `target` of them, all
/// inside the range; the middle alone when they are apart by round-off only. low < high, both finite.
std::vector<double> round_ticks(double low, double high, int target);

/// Label of a tick: enough decimals to tell ticks `step` apart, power-of-ten form for very large or small
/// steps.
std::string tick_text(double value, double step);

}  // namespace rhytid
