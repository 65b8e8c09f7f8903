// Writes and compares what pictures and sound were made of.
#include <rtsg/session/provenance.h>

#include <algorithm>
#include <ranges>
#include <vector>

#include <fmt/format.h>

namespace rtsg {

namespace {

struct Key {
    const char* name;
    std::string Provenance::* value;
};
constexpr Key kKeys[] = {{"rtsg-session", &Provenance::session},
                         {"rtsg-state", &Provenance::state},
                         {"rtsg-options", &Provenance::options},
                         {"rtsg-version", &Provenance::version}};

std::vector<std::string> optionsIn(const std::string& text) {
    std::vector<std::string> words;
    for (const auto word : text | std::views::split(',')) words.emplace_back(word.begin(), word.end());
    return words;
}

/// "spp=4, not spp=1": only the options that differ, where they are the same ones.
std::string whatDiffers(const std::string& a, const std::string& b) {
    const std::vector<std::string> ours = optionsIn(a), theirs = optionsIn(b);
    if (ours.size() != theirs.size()) return fmt::format("{}, not {}", a, b);
    std::string one, other;
    for (std::size_t i = 0; i < ours.size(); ++i) {
        if (ours[i] == theirs[i]) continue;
        one += (one.empty() ? "" : " ") + ours[i];
        other += (other.empty() ? "" : " ") + theirs[i];
    }
    return fmt::format("{}, not {}", one, other);
}

Result<> sameIn(std::string Provenance::* what, const char* name, const Provenance& other, const std::string& file,
                const Provenance& first, const std::string& firstFile) {
    if (other.*what == first.*what) return {};
    return fail(fmt::format("a mixture: {} {} as in {}", name, whatDiffers(other.*what, first.*what), firstFile), {},
                file);
}

}  // namespace

Provenance Provenance::ofHere(std::string session, std::string options, std::string state) {
    return {std::move(session), std::move(options), std::move(state), RTSG_VERSION};
}

Provenance Provenance::of(const PictureNotes& notes) {
    Provenance found;
    for (const auto& [name, text] : notes)
        for (const Key& key : kKeys)
            if (name == key.name) found.*key.value = text;
    return found;
}

Provenance Provenance::of(const std::string& comment) {
    PictureNotes notes;
    for (const auto line : comment | std::views::split('\n')) {
        const std::string text(line.begin(), line.end());
        const std::size_t equals = text.find('=');
        if (equals != text.npos) notes.emplace_back(text.substr(0, equals), text.substr(equals + 1));
    }
    return of(notes);
}

PictureNotes Provenance::notes() const {
    PictureNotes notes;
    for (const Key& key : kKeys) notes.emplace_back(key.name, this->*key.value);
    return notes;
}

std::string Provenance::comment() const {
    std::string text;
    for (const Key& key : kKeys) text += fmt::format("{}={}\n", key.name, this->*key.value);
    return text;
}

std::string pictureSettings(const ImageOptions& image, const ToneMap& toneMap, const TessellationError& tessellation) {
    constexpr const char *kIntegrators[] = {"whitted", "path", "raster"},
                         *kShadows[] = {"authored", "all", "none", "auto"}, *kSpaces[] = {"auto", "linear", "display"},
                         *kStereo[] = {"none", "beside", "above"};
    const RenderSettings& s = image.settings;
    const auto chosen = [](const auto& names, auto value) { return names[static_cast<std::size_t>(value)]; };
    return fmt::format(
        "size={}x{},viewpoint={},integrator={},spp={},error={},depth={},shadows={},color-space={},tessellation={}px "
        "{}m "
        "{},shutter={},seed={},exposure={},caps={},panorama={},stereo={},eye-distance={},lens={},focus={}",
        s.width, s.height, image.viewpoint, chosen(kIntegrators, s.integrator), s.samplesPerPixel, s.error, s.maxDepth,
        chosen(kShadows, s.shadows), chosen(kSpaces, s.colorSpace), tessellation.pixels, tessellation.metres,
        tessellation.ofRadius, s.shutter, s.seed, toneMap.exposure, s.caps, image.panorama,
        chosen(kStereo, image.stereo), image.eyeDistance, image.lensRadius, image.focus);
}

Result<> belongsTogether(const Provenance& other, const std::string& file, const Provenance& first,
                         const std::string& firstFile) {
    if (other.empty() != first.empty()) {
        const std::string &without = other.empty() ? file : firstFile, &with = other.empty() ? firstFile : file;
        return fail("a mixture: it does not say of which session it is, as " + with + " does", {}, without);
    }
    if (auto ok = sameIn(&Provenance::session, "session", other, file, first, firstFile); !ok) return ok;
    if (auto ok = sameIn(&Provenance::options, "options", other, file, first, firstFile); !ok) return ok;
    return sameIn(&Provenance::version, "version", other, file, first, firstFile);
}

Result<> isOneState(const Provenance& other, const std::string& file, const Provenance& first,
                    const std::string& firstFile) {
    if (auto ok = belongsTogether(other, file, first, firstFile); !ok) return ok;
    return sameIn(&Provenance::state, "state", other, file, first, firstFile);
}

}  // namespace rtsg
