// Denoising: smooths pictures with few samples, for people who watch a scene live.
//
// The result is a preview: details that one picture does not tell from noise (sharp shadows and reflections, above all
// in mirrors) are blurred, and no error interval holds for it. Surfaces, their edges and their textures stay sharp.
// PathPreview (path_preview.h) uses two pictures to recognise noise, and shows no result that is worse than the mean.
// Threading: re-entrant; uses parallelFor(). Source: Dammertz et al. 2010 (edge-avoiding wavelets), Schied et al. 2017
// (weights by variance, light without the surface's colour).
//
// Example:
//     #include <rtsg/renderers/denoise.h>
//     rtsg::Picture picture(2, 1);
//     const rtsg::Result<> done = rtsg::denoise(picture);
//     if (!done) std::cout << done.error().text << '\n';  // it has no layers to tell surfaces by
#pragma once

#include <cstdint>

#include <rtsg/core/diagnostic.h>
#include <rtsg/renderers/picture.h>

namespace rtsg {

/// The RenderSettings::layers by which denoise() tells surfaces apart.
extern const std::uint32_t kLayersOfDenoising;

/// Errors: a picture of display values; layers are missing; the picture has an error interval (Picture::interval),
/// which a filter would make wrong.
Result<> denoise(Picture& picture);

}  // namespace rtsg
