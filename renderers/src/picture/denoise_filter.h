// The filter of denoise.h for two pictures at once, whose difference tells of noise.
//
// Threading: as denoise().
#pragma once

#include <functional>

#include <rtsg/renderers/denoise.h>

namespace rtsg {

/// Of two pictures of the same by independent samples, as many each; `guide` has the layers of one of them. What noise
/// does not explain stays, mirrored things, too. False: `goesOn`, asked now and then unless it is null, said so, and
/// the pictures are as they were. Errors: as denoise(); sizes that differ.
Result<bool> denoiseHalves(const Picture& guide, Picture& first, Picture& second, const std::function<bool()>& goesOn);

}  // namespace rtsg
