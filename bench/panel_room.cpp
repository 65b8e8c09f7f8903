// Writes the room as text.
#include "panel_room.h"

#include <cmath>

#include <fmt/format.h>

namespace rtsg::bench {

namespace {

/// A lamp's material; `mirrors`: it mirrors a trace of light too, so that only bounces find it.
std::string lamp(double radiance, bool mirrors) {
    return fmt::format("material Material {{ diffuseColor 0 0 0 emissiveColor {0} {0} {0} {1} }}", radiance,
                       mirrors ? "metadata MetadataFloat { name \"reflectivity\" reference \"RTSG\" value 1e-7 }" : "");
}

}  // namespace

std::vector<Vec3f> lampMiddles(int lamps) {
    const int side = static_cast<int>(std::ceil(std::sqrt(lamps)));
    std::vector<Vec3f> middles;
    for (int i = 0; i < lamps; ++i) {
        const int row = i / side;
        middles.emplace_back((i % side + .5) / side * 3 - 1.5, 1.49, (row + .5) / side * 3 - 1.5);
    }
    return middles;
}
double lampHalf(int lamps) {
    return std::sqrt(.18 / lamps) / 2;
}

std::string panelRoom(int lamps, bool mirrors, bool seen) {
    std::string text = fmt::format(
        "#X3D V4.0 utf8\nPROFILE Immersive\nNavigationInfo {{ headlight FALSE }}\n"
        "Viewpoint {{ position 0 0 1.9 orientation 1 0 0 {} fieldOfView {} }}\n",
        seen ? 0 : -.5, seen ? 1 : .8);
    text +=
        "Shape { appearance Appearance { material Material { diffuseColor .87 .87 .87 } } geometry Box { size 4 3 4 "
        "solid FALSE } }\n"
        "Transform { translation -.6 -1 -.5 children Shape { appearance Appearance { material Material { diffuseColor "
        ".8 .3 .2 specularColor .2 .2 .2 shininess .3 } } geometry Sphere { radius .5 } } }\n"
        "Transform { translation .6 -1 0 children Shape { appearance Appearance { material PhysicalMaterial { "
        "baseColor .2 .5 .8 roughness .4 metallic .5 } } geometry Box { size .8 1 .8 } } }\n";
    const double half = lampHalf(lamps);
    for (const Vec3f& middle : lampMiddles(lamps))
        text += fmt::format(
            "Transform {{ translation {0} {4} {1} children Shape {{ appearance Appearance {{ {2} }} geometry "
            "IndexedFaceSet {{ coordIndex [0 1 2 3 -1] coord Coordinate {{ point [-{3} 0 -{3}, {3} 0 -{3}, {3} 0 {3}, "
            "-{3} 0 {3}] }} }} }} }}\n",
            middle.x, middle.z, lamp(1, mirrors), half, middle.y);
    return text;
}

}  // namespace rtsg::bench
