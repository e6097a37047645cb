// The words that scene files use for enumerations, in the order of the enumerators.
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "sim/scene/parameter.h"
#include "sim/scene/scene.h"

namespace rhytid {

/// words[i] is the name of enumerator i. Specialised for every enumeration that a scene file can hold.
template <class Enum>
struct EnumNames;
template <>
struct EnumNames<DamperScheme> {
  static constexpr std::array<std::string_view, 5> words{"exponential", "literal", "strang", "backward_euler",
                                                         "none"};
};
template <>
struct EnumNames<FrictionLag> {
  static constexpr std::array<std::string_view, 2> words{"previous", "extrapolated"};
};
template <>
struct EnumNames<RimCondition> {
  static constexpr std::array<std::string_view, 3> words{"clamped", "sliding", "free"};
};
template <>
struct EnumNames<ThicknessScheme> {
  static constexpr std::array<std::string_view, 2> words{"stacked", "composite"};
};
template <>
struct EnumNames<LigamentForm> {
  static constexpr std::array<std::string_view, 2> words{"exponential", "fung_quadratic"};
};
template <>
struct EnumNames<VolumeQuadrature> {
  static constexpr std::array<std::string_view, 2> words{"full", "reduced"};
};
template <>
struct EnumNames<RuleKind> {
  static constexpr std::array<std::string_view, 3> words{"product", "full", "sheet"};
};
template <>
struct EnumNames<ShapeKind> {
  static constexpr std::array<std::string_view, 5> words{"sphere", "plane", "imls", "capsule", "ellipsoid"};
};
template <>
struct EnumNames<PathKind> {
  static constexpr std::array<std::string_view, 3> words{"linear", "spline", "clamped_spline"};
};

/// Not of scenes: of cases, records and lists of parameters.
template <>
struct EnumNames<ParameterTransform> {
  static constexpr std::array<std::string_view, 3> words{"none", "log", "logit"};
};

/// The word for a value: "exponential", "clamped", ...
template <class Enum>
std::string to_string(Enum value) {
  return std::string(EnumNames<Enum>::words[static_cast<size_t>(value)]);
}

/// All words of an enumeration.
template <class Enum>
std::vector<std::string> enum_words() {
  return {EnumNames<Enum>::words.begin(), EnumNames<Enum>::words.end()};
}

}  // namespace rhytid
