// A scene from ClassicVRML text with an Imager on it, and its pixels; for the light tracer's tests.
#pragma once

#include <memory>
#include <string>

#include <gtest/gtest.h>

#include <rtsg/core/loader.h>
#include <rtsg/renderers/image.h>

namespace rtsg::test {

struct LightScene {
    Scene scene;
    Diagnostics diagnostics;
    std::unique_ptr<Imager> imager;
    ImageOptions options;
    RenderStats stats;

    /// `body` without the header. Unless it has its own, a NavigationInfo without headlight and the default Viewpoint
    /// are put before it ("frame" in a comment: no Viewpoint).
    explicit LightScene(const std::string& body, int width = 33, int height = 33, Imager::Options imagerOptions = {}) {
        std::string text = "#X3D V4.0 utf8\nPROFILE Immersive\n";
        if (body.find("NavigationInfo") == std::string::npos) text += "NavigationInfo { headlight FALSE }\n";
        if (body.find("Viewpoint") == std::string::npos && body.find("# frame") == std::string::npos)
            text += "Viewpoint { }\n";
        EXPECT_TRUE(loadText(scene, text + body, diagnostics));
        for (const Diagnostic& d : diagnostics.all()) ADD_FAILURE() << d.format();
        imager = std::make_unique<Imager>(scene, std::move(imagerOptions));
        scene.newFrame(0);
        options.settings.width = width;
        options.settings.height = height;
    }
    Picture picture() {
        auto result = imager->picture(options, &stats);
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

}  // namespace rtsg::test
