// The fingerprint of what a model was built from.
#pragma once

#include <string>

#include "sim/time/model.h"

namespace rhytid {

/// Digest of the model's numbers: mesh, parameters, rest data of every term (rest gaps, and with them the
/// bone). Tells models apart whose scenes read alike but whose files (mesh, maps, points) have changed.
std::string content_digest(const Model& model);

}  // namespace rhytid
