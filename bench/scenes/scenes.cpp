// The list of bench scenes.
#include "scenes.h"

#include <algorithm>
#include <array>
#include <cctype>

#include "models.h"

namespace rtsg::bench {

namespace {

constexpr std::array kScenes = {
    SceneInfo{"Beetles", "a car park; parts shared by DEF and USE", 2.4e6},
    SceneInfo{"Venice", "a canal; large textures, windows that mirror and refract", 1.2e6},
    SceneInfo{"Conference", "a room with 22 chairs, nothing shared", 280e3, false, .12},
    SceneInfo{"Campus", "buildings and trees, nothing shared", 4.3e6, false, 3},
    SceneInfo{"Kitchen", "steel and glass; a toy car drives about", 108e3, true},
    SceneInfo{"Troopers", "48 figures march, each joint animated", 19e3, true},
    SceneInfo{"Escherknot", "a knot deformed by a CoordinateInterpolator", 4.6e3, true},
    SceneInfo{"City", "towers shared through three levels of DEF and USE", 1e9},
};

bool sameWord(std::string_view a, std::string_view b) {
    return std::ranges::equal(
        a, b, {}, [](unsigned char c) { return std::tolower(c); }, [](unsigned char c) { return std::tolower(c); });
}

}  // namespace

std::span<const SceneInfo> benchScenes() {
    return kScenes;
}
const SceneInfo* findBenchScene(std::string_view name) {
    const auto found = std::ranges::find_if(kScenes, [&](const SceneInfo& s) { return sameWord(s.name, name); });
    return found == kScenes.end() ? nullptr : &*found;
}

Result<std::uint64_t> writeBenchScene(std::string_view name, double scale, bool teapot,
                                      const std::filesystem::path& folder) {
    const SceneInfo* info = findBenchScene(name);
    if (!info) return fail(fmt::format("no scene is called {}", name));
    if (!(scale > 0 && scale <= 1)) return fail(fmt::format("a scale of {} is not in (0, 1]", scale));
    if (teapot && info->teapotScale == 0) return fail(fmt::format("{} has no place for a teapot", info->name));
    std::error_code error;
    std::filesystem::create_directories(folder, error);
    SceneFile file(folder / fmt::format("{}.x3dv", info->name));
    const Detail detail{scale};
    const std::string_view which = info->name;
    if (which == "Beetles") writeBeetles(file, detail);
    if (which == "Venice")
        if (auto ok = writeVenice(file, detail, folder); !ok) return std::unexpected(ok.error());
    if (which == "Conference") writeConference(file, detail);
    if (which == "Campus") writeCampus(file, detail);
    if (which == "Kitchen") writeKitchen(file, detail);
    if (which == "Troopers") writeTroopers(file, detail);
    if (which == "Escherknot") writeEscherknot(file, detail);
    if (which == "City") writeCity(file, detail);
    if (teapot) {
        const Vec3f at = which == "Campus" ? Vec3f(-26, .1f, 78) : Vec3f(0, .765f, 0);
        writeTeapot(file, {.translation = at, .scale = Vec3f(static_cast<float>(info->teapotScale))}, detail);
    }
    return file.finish();
}

}  // namespace rtsg::bench
