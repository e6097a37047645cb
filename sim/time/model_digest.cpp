#include "sim/time/model_digest.h"

#include "sim/core/digest.h"

namespace rhytid {

std::string content_digest(const Model& model) {
  Digest d;
  d.matrix(model.mesh.rest);
  for (const int column : model.mesh.face_columns) d.number(column);
  d.matrix(model.native);
  for (const Term& term : model.terms)
    for (const TermGroup& group : term.groups())
      for (const double value : group.rest) d.number(value);
  return d.hex();
}

}  // namespace rhytid
