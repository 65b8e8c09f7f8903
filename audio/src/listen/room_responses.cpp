// Lays out the responses of a room as SOFA wants them.
#include <rtsg/audio/room_report.h>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <map>
#include <string_view>

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <rtsg/core/output_file.h>

#include "sound_io/netcdf_file.h"

namespace rtsg {
namespace {

using ResponseChannels = ImpulseResponseOptions::Channels;

/// Converts X3D's axes to axes with z up.
glm::dvec3 zUp(const glm::dvec3& v) {
    return {v.x, 0 - v.z, v.y};  // no -0
}

void append(std::vector<double>& values, const glm::dvec3& v) {
    values.insert(values.end(), {v.x, v.y, v.z});
}

/// A direction at a right angle to another, as far up as may be.
glm::dvec3 upBeside(const glm::dvec3& ahead) {
    const glm::dvec3 other = std::abs(ahead.y) < 0.999 ? glm::dvec3(0, 1, 0) : glm::dvec3(0, 0, 1);
    return glm::normalize(other - ahead * glm::dot(other, ahead));
}

std::string timeOfWriting() {
    std::time_t now = std::time(nullptr);
    if (const char* reported = std::getenv("SOURCE_DATE_EPOCH"))
        now = static_cast<std::time_t>(std::strtoll(reported, nullptr, 10));
    return fmt::format("{:%Y-%m-%d %H:%M:%S}", fmt::gmtime(now));
}

const NetcdfAttributes& cartesian() {
    static const NetcdfAttributes attributes{{"Type", "cartesian"}, {"Units", "metre"}};
    return attributes;
}

const char* aboutReceivers(const RoomResponses& room) {
    switch (room.channels) {
        case ResponseChannels::mono:
            return "pressure at the listener";
        case ResponseChannels::stereo:
            return "left and right, panned for two loudspeakers";
        case ResponseChannels::binaural:
            return "left and right ear";
        case ResponseChannels::ambisonic:
            return "ambisonic channels of real spherical harmonics: ACN order, SN3D normalisation, x ahead, y left, z "
                   "up";
    }
    return "";
}

NetcdfAttributes globalAttributes(const RoomResponses& room) {
    const bool panned = room.channels == ResponseChannels::stereo;
    const std::string now = timeOfWriting();
    std::string about = room.box ? "box" : "room of the scene's walls";
    if (!room.scene.empty()) about += fmt::format(", {}", room.scene);
    NetcdfAttributes all{
        {"Conventions", "SOFA"},
        {"Version", "2.1"},
        {"SOFAConventions", panned ? "GeneralFIR" : "SingleRoomSRIR"},
        {"SOFAConventionsVersion", "1.0"},
        {"DataType", "FIR"},
        {"RoomType", room.box ? "shoebox" : "reverberant"},
        {"Title", room.title},
        {"DateCreated", now},
        {"DateModified", now},
        {"APIName", "rtsg::writeSofa"},
        {"APIVersion", "1"},
        {"AuthorContact", "unknown"},
        {"Organization", "unknown"},
        {"License", "No license provided, ask the author for permission"},
        {"ApplicationName", room.application},
        {"ApplicationVersion", room.applicationVersion},
        {"Comment",
         "simulated; pressure 1 is that of the source at 1 m in free field; z is up: (x, -z, y) of the scene"},
        {"DatabaseName", room.title},
        {"RoomDescription", about},
        {"ListenerDescription", "points, named by ListenerNumber"},
        {"ReceiverDescription", aboutReceivers(room)},
        {"SourceDescription", "points, named by SourceNumber"},
        {"EmitterDescription", "the source itself"},
    };
    if (!room.scene.empty()) all.emplace_back("RoomGeometry", room.scene);
    return all;
}

/// The receivers, in the listener's frame.
NetcdfVariable receivers(const RoomResponses& room, std::size_t count) {
    // In a frame that looks along x the field is described about the middle, wherever it is evaluated.
    if (room.channels == ResponseChannels::ambisonic)
        return {.name = "ReceiverPosition",
                .dimensions = "IC",
                .values = {0, 0, 0},
                .attributes = {{"Type", "spherical harmonics"}, {"Units", "degree, degree, metre"}}};
    NetcdfVariable variable{.name = "ReceiverPosition", .dimensions = "RCI", .values = {}, .attributes = cartesian()};
    const double radius = room.pairs.front().headRadius;
    const auto position = [&](std::size_t r, double ofHead) -> glm::dvec3 {
        return {0, room.channels == ResponseChannels::binaural ? (r == 0 ? ofHead : -ofHead) : 0, 0};
    };
    const bool alike = room.channels != ResponseChannels::binaural ||
                       std::ranges::all_of(room.pairs, [&](const auto& pair) { return pair.headRadius == radius; });
    if (!alike) variable.dimensions = "RCM";
    for (std::size_t r = 0; r < count; ++r) {
        if (alike) {
            append(variable.values, position(r, radius));
            continue;
        }
        // Heads of several sizes: coordinate by coordinate, of all measurements.
        for (int c = 0; c < 3; ++c)
            for (const RoomResponses::Pair& pair : room.pairs)
                variable.values.push_back(position(r, pair.headRadius)[c]);
    }
    return variable;
}

/// Adds the places of everything, measurement by measurement.
void insertEntries(const RoomResponses& room, std::vector<NetcdfVariable>& variables) {
    const auto add = [&](const char* name, bool described, const auto& of) {
        NetcdfVariable& variable =
            variables.emplace_back(NetcdfVariable{.name = name, .dimensions = "MC", .values = {}, .attributes = {}});
        if (described) variable.attributes = cartesian();
        for (const RoomResponses::Pair& pair : room.pairs) append(variable.values, zUp(of(pair)));
    };
    const auto aim = [](const RoomResponses::Pair& pair) {
        return glm::length(pair.sourceAim) > 0 ? glm::normalize(pair.sourceAim) : glm::dvec3(1, 0, 0);
    };
    add("ListenerPosition", true, [](const auto& pair) { return pair.listenerAt; });
    add("ListenerView", true, [](const auto& pair) { return -pair.listenerAxes[2]; });
    add("ListenerUp", false, [](const auto& pair) { return pair.listenerAxes[1]; });
    add("SourcePosition", true, [](const auto& pair) { return pair.sourceAt; });
    add("SourceView", true, aim);
    add("SourceUp", false, [&](const auto& pair) { return upBeside(aim(pair)); });
    variables.push_back(
        {.name = "EmitterPosition", .dimensions = "ECI", .values = {0, 0, 0}, .attributes = cartesian()});
}

void addRoom(const RoomResponses& room, std::vector<NetcdfVariable>& variables) {
    variables.push_back({.name = "RoomTemperature",
                         .dimensions = "I",
                         .values = {room.air.celsius + 273.15},
                         .attributes = {{"Units", "kelvin"}}});
    if (!room.box) return;
    const glm::dvec3 a = zUp(room.box->low), b = zUp(room.box->high), size = glm::abs(b - a);
    const auto corner = [&](const char* name, const glm::dvec3& at) {
        variables.push_back({.name = name, .dimensions = "IC", .values = {at.x, at.y, at.z}});
    };
    corner("RoomCornerA", glm::min(a, b));
    corner("RoomCornerB", glm::max(a, b));
    variables.push_back({.name = "RoomCorners", .dimensions = "II", .values = {0}, .attributes = cartesian()});
    variables.push_back({.name = "RoomVolume",
                         .dimensions = "I",
                         .values = {size.x * size.y * size.z},
                         .attributes = {{"Units", "cubic metre"}}});
}

/// Identifies sources and listeners: a number from 0 on for each measurement, and the names in an attribute, one a
/// line. A variable of characters is avoided because some readers of SOFA refuse it.
NetcdfVariable numbers(const char* name, const RoomResponses& room, std::string RoomResponses::Pair::* who) {
    constexpr std::size_t kLongest = 60'000;  // bytes that an attribute may take
    NetcdfVariable variable{.name = name, .dimensions = "M", .values = {}};
    std::map<std::string_view, double> known;
    std::string names;
    for (const RoomResponses::Pair& pair : room.pairs) {
        const std::string& its = pair.*who;
        const auto [at, fresh] = known.try_emplace(its, static_cast<double>(known.size()));
        variable.values.push_back(at->second);
        if (fresh && names.size() + its.size() < kLongest) names += names.empty() ? its : "\n" + its;
    }
    variable.attributes = {{"Names", names}};
    return variable;
}

NetcdfFile layOut(const RoomResponses& room) {
    std::size_t frames = 1;
    const std::size_t count = room.pairs.front().response.channels.size();
    NetcdfVariable responses{.name = "Data.IR", .dimensions = "MRN", .values = {}};
    for (const RoomResponses::Pair& pair : room.pairs) {
        frames = std::max(frames, pair.response.frames());
        for (const std::vector<float>& channel : pair.response.channels) responses.rows.emplace_back(channel);
    }
    NetcdfFile file{{{'I', 1}, {'C', 3}, {'R', count}, {'E', 1}, {'N', frames}, {'M', room.pairs.size()}},
                    globalAttributes(room),
                    {}};
    insertEntries(room, file.variables);
    file.variables.push_back(receivers(room, count));
    addRoom(room, file.variables);
    file.variables.push_back(std::move(responses));
    file.variables.push_back({.name = "Data.SamplingRate",
                              .dimensions = "I",
                              .values = {static_cast<double>(room.sampleRate)},
                              .attributes = {{"Units", "hertz"}}});
    file.variables.push_back({.name = "Data.Delay", .dimensions = "IR", .values = std::vector<double>(count, 0.0)});
    file.variables.push_back(numbers("SourceNumber", room, &RoomResponses::Pair::source));
    file.variables.push_back(numbers("ListenerNumber", room, &RoomResponses::Pair::listener));
    return file;
}

}  // namespace

Result<> writeSofa(const std::string& path, const RoomResponses& room) {
    if (room.pairs.empty()) return fail("there are no responses to write", {}, path);
    const std::size_t count = room.pairs.front().response.channels.size();
    for (const RoomResponses::Pair& pair : room.pairs)
        if (pair.response.channels.size() != count || pair.response.sampleRate != room.sampleRate || count == 0)
            return fail("responses of one file have the same channels and sample rate", {}, path);
    const auto writer = netcdfWriter();
    if (!writer) return fail(writer.error().text, {}, path);
    const std::filesystem::path fresh = freshNameBeside(path);
    std::error_code failure;
    if (const std::string error = (*writer)->write(fresh.string(), layOut(room)); !error.empty()) {
        std::filesystem::remove(fresh, failure);
        return fail("cannot write SOFA: " + error, {}, path);
    }
    // If the name is a link, writes to its target.
    const std::filesystem::path target =
        std::filesystem::exists(path) ? std::filesystem::canonical(path) : std::filesystem::path(path);
    std::filesystem::rename(fresh, target, failure);
    if (!failure) return {};
    const std::string why = failure.message();
    std::filesystem::remove(fresh, failure);
    return fail("cannot write SOFA: " + why, {}, path);
}

}  // namespace rtsg
