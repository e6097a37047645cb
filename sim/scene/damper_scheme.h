// The time integration of the Maxwell damper (see sim/terms/damper.h for the formulas).
#pragma once

namespace rhytid {

enum class DamperScheme { exponential, literal, strang, backward_euler, none };

}  // namespace rhytid
