// A scene from ClassicVRML text with a LightRenderer on it, and its pixels; for the light tracer's tests.
#pragma once

#include <cmath>
#include <memory>
#include <numbers>
#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <rtsg/documents/loader.h>
#include <rtsg/renderers/image.h>

namespace rtsg::test {

struct LightScene {
    Scene scene;
    Diagnostics diagnostics;
    std::unique_ptr<SharedWorld> world;
    std::unique_ptr<LightRenderer> light;
    ImageOptions options;
    RenderStats stats;

    /// `body` without the header. Unless it has its own, a NavigationInfo without headlight and the default Viewpoint
    /// are put before it ("frame" in a comment: no Viewpoint).
    explicit LightScene(const std::string& body, int width = 33, int height = 33,
                        LightRenderer::Options lightOptions = {}) {
        std::string text = "#X3D V4.0 utf8\nPROFILE Immersive\n";
        if (body.find("NavigationInfo") == std::string::npos) text += "NavigationInfo { headlight FALSE }\n";
        if (body.find("Viewpoint") == std::string::npos && body.find("# frame") == std::string::npos)
            text += "Viewpoint { }\n";
        EXPECT_TRUE(loadText(scene, text + body, diagnostics));
        for (const Diagnostic& d : diagnostics.all()) ADD_FAILURE() << d.format();
        world = std::make_unique<SharedWorld>(scene);
        light = std::make_unique<LightRenderer>(*world, std::move(lightOptions));
        scene.newFrame(0);
        options.settings.width = width;
        options.settings.height = height;
    }
    Picture picture() {
        auto result = light->picture(options, &stats);
        if (!result) {
            ADD_FAILURE() << result.error().format();
            return Picture(options.settings.width, options.settings.height);
        }
        return std::move(*result);
    }
    Vec3f center() {
        const Picture p = picture();
        return Vec3f(p.at(p.width / 2, p.height / 2));
    }
    NodeId node(const char* name) {
        const NodeId id = scene.findName(name);
        EXPECT_TRUE(id) << name;
        return id;
    }
};

inline void expectColor(const Vec3f& seen, const Vec3d& expected, double tolerance) {
    EXPECT_NEAR(seen.r, expected.r, tolerance);
    EXPECT_NEAR(seen.g, expected.g, tolerance);
    EXPECT_NEAR(seen.b, expected.b, tolerance);
}

constexpr double kPi = std::numbers::pi;

/// A square of `half` metres to each side in the plane z = 0, facing +z.
inline std::string square(double half, const std::string& appearance, const std::string& more = "solid FALSE") {
    return fmt::format(
        "Shape {{ appearance Appearance {{ {1} }} geometry IndexedFaceSet {{ {2} coordIndex [0 1 2 3 -1] "
        "coord Coordinate {{ point [-{0} -{0} 0, {0} -{0} 0, {0} {0} 0, -{0} {0} 0] }} }} }}\n",
        half, appearance, more);
}
inline std::string unlit(const char* color) {
    return fmt::format("material UnlitMaterial {{ emissiveColor {} }}", color);
}
inline std::string matte(const char* color) {
    return fmt::format("material Material {{ diffuseColor {} ambientIntensity 0 }}", color);
}

/// The ray of a pixel's centre for the default Viewpoint with the given field of view, in double.
inline Vec3d pixelDirection(int x, int y, int width, int height, double fieldOfView) {
    const double t = std::tan(fieldOfView / 2), aspect = double(width) / height;
    const double tx = aspect > 1 ? t * aspect : t, ty = aspect > 1 ? t : t / aspect;
    return glm::normalize(Vec3d((2 * (x + 0.5) / width - 1) * tx, (1 - 2 * (y + 0.5) / height) * ty, -1));
}

inline const char* const kMirror =
    "material Material { diffuseColor 0 0 0 metadata MetadataSet { name \"RTSG\" value MetadataFloat { name "
    "\"reflectivity\" value %s } } }";
inline std::string mirror(const char* value) {
    std::string text = kMirror;
    return text.replace(text.find("%s"), 2, value);
}
inline std::string glass(double n, const char* more = "") {
    return fmt::format(
        "material Material {{ diffuseColor 0 0 0 transparency 1 metadata MetadataSet {{ name \"RTSG\" value [ "
        "MetadataFloat {{ name "
        "\"refractiveIndex\" value {} }} {} ] }} }}",
        n, more);
}

}  // namespace rtsg::test
