// The gradient by the ligaments' exponent b, vertex by vertex: from an adjoint's native_bar to a map of the
// skin.
//
// native_bar has ∂Q/∂b of every column of the mesh (each node of the inner surface, high-order ones
// included), between which b is linear. What a file of b per vertex (/ligaments/map) holds is b at the
// vertices, columns in between taking what is linear between them, b = N b_vertices; so ∂Q/∂b_vertices = Nᵀ
// ∂Q/∂b.
//
// Both are derivatives by single values, and small where columns are dense. For a picture that does not show
// the mesh divide by the area that a value stands for (column_areas in surface_response.h): ∂Q = ∫ g δb dA,
// g = (∂Q/∂b)/area.
//
// Units   of Q times mm (b is 1/mm); g of Q per mm.   Tests   tests/adjoint/outputs_test.cpp
#pragma once

#include "sim/time/model.h"

namespace rhytid::adjoint {

/// ∂Q/∂b of every column, [num_columns]. Throws ContractError for a model without ligaments.
VectorXd ligament_gradient(const Model& model, const VectorXd& native_bar);

/// ∂Q/∂b of every vertex of the (cropped) input surface, [num_vertices], b linear between vertices as from a
/// map file (whose values map_scale multiplies).
VectorXd ligament_gradient_by_vertex(const Model& model, const VectorXd& native_bar);

}  // namespace rhytid::adjoint
