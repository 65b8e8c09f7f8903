// The 95 % interval of a figure that is computed from batches of rays. Threading: a pure function.
#pragma once

#include <span>

namespace rtsg {

/// Half width, from the delete-one jackknife over batches: `without` has the figure without each, `whole` is that of
/// all. Its bias (Quenouille 1956) counts too: a figure that few rays make is off to one side by more than they vary.
double halfWidth95(std::span<const double> without, double whole);

}  // namespace rtsg
