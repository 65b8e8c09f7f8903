// Runs POV-Ray and reads the PPM that it writes.
#include "pov_ray.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <vector>

#include <fmt/format.h>

#include "bench.h"

namespace rtsg::bench {

namespace {

double secondsOfChildren() {
    rusage used{};
    ::getrusage(RUSAGE_CHILDREN, &used);
    const auto seconds = [](const timeval& t) {
        return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
    };
    return seconds(used.ru_utime) + seconds(used.ru_stime);
}

/// A PPM of two bytes a channel, linear, with a header of three lines and remarks between them.
std::optional<Picture> readPpm(const std::filesystem::path& file) {
    std::ifstream in(file, std::ios::binary);
    std::string kind;
    int width = 0, height = 0, maximum = 0;
    std::string header;
    for (std::string line; header.empty() || std::count(header.begin(), header.end(), '\n') < 3;) {
        if (!std::getline(in, line)) return std::nullopt;
        if (!line.starts_with('#')) header += line + '\n';
    }
    std::istringstream words(header);
    if (!(words >> kind >> width >> height >> maximum) || kind != "P6" || maximum != 65535) return std::nullopt;
    std::vector<unsigned char> bytes(std::size_t{6} * static_cast<std::size_t>(width) *
                                     static_cast<std::size_t>(height));
    if (!in.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size())))
        return std::nullopt;
    Picture picture;
    picture.width = width, picture.height = height;
    for (std::size_t at = 0; at < bytes.size(); at += 6) {
        const auto channel = [&](std::size_t i) {
            return static_cast<float>(bytes[at + 2 * i] << 8 | bytes[at + 2 * i + 1]) / 65535;
        };
        picture.pixels.emplace_back(channel(0), channel(1), channel(2), 1);
    }
    return picture;
}

}  // namespace

bool hasPovRay() {
    return isInstalled("povray");
}

std::optional<PovRayPicture> povRayScene(const std::filesystem::path& scene, int side, int count) {
    const std::filesystem::path image = scene.string() + ".ppm", log = scene.string() + ".log";
    const std::string command = fmt::format(
        "povray +I'{}' +O'{}' +FP16 File_Gamma=1.0 +W{} +H{} +A0.0 +AM1 +R3 -D +WT1 Declare=rays={} > /dev/null 2> "
        "'{}'",
        scene.string(), image.string(), side, side, count, log.string());
    const double before = secondsOfChildren();
    const bool created = std::system(command.c_str()) == 0;
    PovRayPicture result;
    result.seconds = secondsOfChildren() - before;
    std::ifstream words(log);
    for (std::string word; words >> word && result.version.empty();)
        if (word == "Version") words >> result.version;
    std::optional<Picture> picture = created ? readPpm(image) : std::nullopt;
    std::filesystem::remove(image);
    std::filesystem::remove(log);
    if (!picture) return std::nullopt;
    result.picture = std::move(*picture);
    return result;
}

}  // namespace rtsg::bench
