// The prototypes behind the urns of portable materials, as text that is read like any other library of prototypes.
#include "portable_materials.h"

namespace rtsg::detail {

const std::string_view kPortableUrn = "urn:rtsg:material:";

// A field of a prototype has the type of what it is connected with: MetadataFloat.value is an MFFloat.
const std::string_view kPortableMaterials = R"(#X3D V4.0 utf8
PROFILE Full
PROTO Glass [ inputOutput MFFloat refractiveIndex 1.5 inputOutput MFFloat absorption 0 inputOutput MFFloat priority 0 ] {
  Material { diffuseColor 0 0 0 transparency 1 metadata MetadataSet { name "RTSG" value [
    MetadataFloat { name "refractiveIndex" value IS refractiveIndex }
    MetadataFloat { name "absorption" value IS absorption }
    MetadataFloat { name "priority" value IS priority } ] } }
}
PROTO Mirror [ inputOutput MFFloat reflectivity 1 ] {
  Material { diffuseColor 0 0 0 metadata MetadataSet { name "RTSG" value
    MetadataFloat { name "reflectivity" value IS reflectivity } } }
}
PROTO Polished [ inputOutput SFColor diffuseColor .8 .8 .8 inputOutput MFFloat reflectivity .1 ] {
  Material { diffuseColor IS diffuseColor metadata MetadataSet { name "RTSG" value
    MetadataFloat { name "reflectivity" value IS reflectivity } } }
}
PROTO Metal [ inputOutput SFColor baseColor .9 .9 .9 inputOutput SFFloat roughness .2 ] {
  PhysicalMaterial { metallic 1 baseColor IS baseColor roughness IS roughness }
}
PROTO Emitter [ inputOutput SFColor emissiveColor 1 1 1 ] {
  Material { diffuseColor 0 0 0 emissiveColor IS emissiveColor }
}
)";

std::optional<std::string_view> portableMaterial(std::string_view url) {
    if (!url.starts_with(kPortableUrn)) return std::nullopt;
    return url.substr(kPortableUrn.size());
}

}  // namespace rtsg::detail
