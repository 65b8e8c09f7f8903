// The library of materials behind the urns urn:rtsg:material:NAME, as the tracer knows them.
//
// EXTERNPROTOs name such a urn first, and a file after it. Here the urn leads to these prototypes, whose bodies have
// the metadata that the renderers read. Other programs use the file, examples/materials/materials.x3dv, which shows a
// similar Material. Both have the same interfaces. Threading: constants. Source: RTSG paper 7; ISO/IEC 19775-1 V4.0
// 4.4.5.
#pragma once

#include <optional>
#include <string_view>

namespace rtsg::detail {

/// "urn:rtsg:material:", before the name of a prototype.
extern const std::string_view kPortableUrn;
/// A document in ClassicVRML that declares all of them.
extern const std::string_view kPortableMaterials;

/// The name behind our urn; none: the url is another one.
std::optional<std::string_view> portableMaterial(std::string_view url);

}  // namespace rtsg::detail
