// Opens the files of sound sources and films, and writes down their lengths.
#include "media_reports.h"

#include <cmath>
#include <string>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>

#include "fetch_ahead.h"
#include "media_length.h"

namespace rtsg {

namespace {

struct MediaFields {
    Field<Time> duration;
    Field<bool> load;
    Field<Array<String>> url;
};

template <class N>
constexpr MediaFields fieldsOf() {
    return {N::_duration, N::load, N::url};
}

std::optional<MediaFields> mediaFields(const Node& node) {
    if (node.is(x3d::AudioClip::type)) return fieldsOf<x3d::AudioClip>();
    if (node.is(x3d::MovieTexture::type)) return fieldsOf<x3d::MovieTexture>();
    if (node.is(x3d::BufferAudioSource::type)) return fieldsOf<x3d::BufferAudioSource>();
    return std::nullopt;
}

/// The length of the first url's file whose length can be found. If there is none, returns -1, and `why` has the reason
/// for each url.
double secondsOf(const Scene& scene, const Node& node, const MediaFields& fields, const Resources& resources,
                 const MediaLength& others, std::string& why) {
    if (!node.get(fields.load)) return -1;
    for (const String& url : node.get(fields.url)) {
        const auto resource = resources.open(scene, node, fields.url.index, url.view());
        why += why.empty() ? "" : "; ";
        if (!resource) {
            why += resource.error().text;
            continue;
        }
        const Resource& file = *resource;
        std::optional<double> seconds = mediaSeconds(
            {file.size(), [&](std::uint64_t offset, std::size_t length) { return file.readAt(offset, length); }});
        if (!seconds && others) seconds = others(file);
        if (seconds && std::isfinite(*seconds) && *seconds >= 0) return *seconds;
        why += fmt::format("'{}' is no sound or film whose length can be told", urlForMessage(url.view()));
    }
    return -1;
}

/// A buffer that is given as numbers plays whatever the urls lead to.
bool needsFile(const Node& node) {
    return !node.is(x3d::BufferAudioSource::type) || node.get(x3d::BufferAudioSource::buffer).empty();
}

}  // namespace

MediaReports::MediaReports(const Scene& scene) {
    scene.forEachNode([&](const Node& node) {
        if (const auto fields = mediaFields(node); fields && node.get(fields->duration).seconds < 0)
            asked_.insert(node.id().value);
    });
}

void MediaReports::note(const Scene& scene, const ChangeSet& set) {
    for (const Change& change : set.changes) {
        if (change.kind != ChangeKind::setField) continue;
        // Most changes are of other types than `url` and `load`: they cost no look at their node.
        const FieldType type = change.value.type();
        if (type != FieldType::MFString && type != FieldType::SFBool) continue;
        const Node* node = scene.find(change.node);
        const auto fields = node ? mediaFields(*node) : std::nullopt;
        if (fields && (change.field == fields->url.index || change.field == fields->load.index))
            asked_.insert(change.node.value);
    }
}

std::size_t MediaReports::answer(Scene& scene, const Resources& resources, const MediaLength& others,
                                 Diagnostics& diagnostics) {
    std::size_t count = 0;
    for (const std::uint32_t number : std::exchange(asked_, {})) {
        const Node* node = scene.find(NodeId{number});
        const auto fields = node ? mediaFields(*node) : std::nullopt;
        if (!fields) continue;
        if (node->get(fields->load) && awaitsUrls(scene, *node, fields->url.index, resources)) {
            asked_.insert(number);
            continue;
        }
        std::string why;
        const Time duration{secondsOf(scene, *node, *fields, resources, others, why)};
        if (duration.seconds < 0 && !why.empty() && needsFile(*node)) {
            const std::string_view name = scene.name(node->id());
            diagnostics.warningAt(scene.locationOf(node->id()), fmt::format("{}{}{} never plays: {}", node->type().name,
                                                                            name.empty() ? "" : " ", name, why));
        }
        if (duration != node->get(fields->duration) && scene.set(node->id(), fields->duration, duration)) ++count;
    }
    return count;
}

}  // namespace rtsg
