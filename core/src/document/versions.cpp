// The node types of VRML97, and those that X3D 4.0 added.
#include "versions.h"

#include <algorithm>
#include <array>

namespace rtsg::detail {

namespace {

// Both sorted.
constexpr std::array<std::string_view, 54> kVrml97 = {"Anchor",
                                                      "Appearance",
                                                      "AudioClip",
                                                      "Background",
                                                      "Billboard",
                                                      "Box",
                                                      "Collision",
                                                      "Color",
                                                      "ColorInterpolator",
                                                      "Cone",
                                                      "Coordinate",
                                                      "CoordinateInterpolator",
                                                      "Cylinder",
                                                      "CylinderSensor",
                                                      "DirectionalLight",
                                                      "ElevationGrid",
                                                      "Extrusion",
                                                      "Fog",
                                                      "FontStyle",
                                                      "Group",
                                                      "ImageTexture",
                                                      "IndexedFaceSet",
                                                      "IndexedLineSet",
                                                      "Inline",
                                                      "LOD",
                                                      "Material",
                                                      "MovieTexture",
                                                      "NavigationInfo",
                                                      "Normal",
                                                      "NormalInterpolator",
                                                      "OrientationInterpolator",
                                                      "PixelTexture",
                                                      "PlaneSensor",
                                                      "PointLight",
                                                      "PointSet",
                                                      "PositionInterpolator",
                                                      "ProximitySensor",
                                                      "ScalarInterpolator",
                                                      "Script",
                                                      "Shape",
                                                      "Sound",
                                                      "Sphere",
                                                      "SphereSensor",
                                                      "SpotLight",
                                                      "Switch",
                                                      "Text",
                                                      "TextureCoordinate",
                                                      "TextureTransform",
                                                      "TimeSensor",
                                                      "TouchSensor",
                                                      "Transform",
                                                      "Viewpoint",
                                                      "VisibilitySensor",
                                                      "WorldInfo"};

constexpr std::array<std::string_view, 27> kSinceX3d40 = {"AcousticProperties",
                                                          "Analyser",
                                                          "AudioDestination",
                                                          "BiquadFilter",
                                                          "BufferAudioSource",
                                                          "ChannelMerger",
                                                          "ChannelSelector",
                                                          "ChannelSplitter",
                                                          "Convolver",
                                                          "Delay",
                                                          "DynamicsCompressor",
                                                          "Gain",
                                                          "HAnimMotion",
                                                          "ListenerPointSource",
                                                          "MicrophoneSource",
                                                          "OscillatorSource",
                                                          "PeriodicWave",
                                                          "PhysicalMaterial",
                                                          "PointProperties",
                                                          "SpatialSound",
                                                          "StreamAudioDestination",
                                                          "StreamAudioSource",
                                                          "TextureProjector",
                                                          "TextureProjectorParallel",
                                                          "TextureProjectorPoint",
                                                          "UnlitMaterial",
                                                          "WaveShaper"};

static_assert(std::ranges::is_sorted(kVrml97) && std::ranges::is_sorted(kSinceX3d40));

}  // namespace

bool isInVersion(std::string_view node, std::string_view version) {
    if (version.starts_with('2')) return std::ranges::binary_search(kVrml97, node);
    if (version.starts_with('3')) return !std::ranges::binary_search(kSinceX3d40, node);
    return true;
}

}  // namespace rtsg::detail
