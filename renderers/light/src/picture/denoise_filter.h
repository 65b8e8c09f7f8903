// The filter of denoise.h for two pictures at once, whose difference shows the noise.
//
// Threading: as denoise().
#pragma once

#include <functional>

#include <rtsg/renderers/denoise.h>

namespace rtsg {

/// Denoises two pictures of the same view with independent samples, as many in each; `guide` has the layers of one of
/// them. Differences that noise does not explain stay, mirrored things included. Returns false if `goesOn`, which is
/// called from time to time unless it is null, returned false; the pictures are then unchanged. Errors: as for
/// denoise(); sizes that differ.
Result<bool> denoiseHalves(const Picture& guide, Picture& first, Picture& second, const std::function<bool()>& goesOn);

}  // namespace rtsg
