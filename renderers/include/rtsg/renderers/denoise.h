// Denoising: pictures of few samples made smooth for people who watch a scene live.
//
// It is a preview: what the filter of one picture cannot tell from noise (shadows and reflections that are sharp, in
// mirrors above all) is blurred, and no interval holds for what comes out. Surfaces, their edges and their textures
// stay. PathPreview (path_preview.h) has two pictures to tell noise by, and shows none that is worse. Threading:
// re-entrant; uses parallelFor(). Source: Dammertz et al. 2010 (edge-avoiding wavelets), Schied et al. 2017 (weights by
// variance, light without the surface's colour).
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

/// RenderSettings::layers that denoise() tells surfaces by.
extern const std::uint32_t kLayersOfDenoising;

/// Errors: a picture of display values; layers that are missing; one whose error is known (Picture::interval), which a
/// filter would make untrue.
Result<> denoise(Picture& picture);

}  // namespace rtsg
