// How each scene is modelled. Each writes everything but the teapot; see scenes.h.
#pragma once

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "scene_file.h"

namespace rtsg::bench {

/// The wanted share of triangles, as resolutions of surfaces and as numbers of things.
struct Detail {
    double scale = 1;
    int lines(int full, int minimum = 4) const {
        return std::max(minimum, static_cast<int>(std::lround(full * std::sqrt(scale))));
    }
    int count(int full, int minimum = 1) const {
        return std::max(minimum, static_cast<int>(std::lround(full * scale)));
    }
};

void writeBeetles(SceneFile& file, const Detail& detail);
Result<> writeVenice(SceneFile& file, const Detail& detail, const std::filesystem::path& folder);
void writeConference(SceneFile& file, const Detail& detail);
void writeCampus(SceneFile& file, const Detail& detail);
void writeKitchen(SceneFile& file, const Detail& detail);
void writeTroopers(SceneFile& file, const Detail& detail);
void writeEscherknot(SceneFile& file, const Detail& detail);
void writeCity(SceneFile& file, const Detail& detail);

/// A teapot of about 6,000 triangles that turns once in four seconds.
void writeTeapot(SceneFile& file, const Placement& placement, const Detail& detail);

/// A car with the shape of a beetle, its front towards x, standing on y = 0, 4 m long.
struct BeetleCar {
    Surface body, glass, rubber, chrome;
};
BeetleCar beetleCar(const Detail& detail);

}  // namespace rtsg::bench
