// "Did you mean ...": the closest word by edit distance, for messages about unknown keys and addresses.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace rhytid {

/// Least number of insertions, deletions, substitutions and swaps of neighbours that turn `a` into `b`
/// (optimal string alignment; bytes; case counts half as much as a different letter, so the unit is 1/2).
int edit_distance(std::string_view a, std::string_view b);

/// The candidate with the least edit distance, the first of equals; "" when there is none.
std::string nearest_word(std::string_view word, const std::vector<std::string>& candidates);

}  // namespace rhytid
