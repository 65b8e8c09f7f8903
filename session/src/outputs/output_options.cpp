// What follows from options of outputs: names, lengths, and which files must be kept.
#include <rtsg/session/output_options.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include <fmt/format.h>

#include <rtsg/documents/resource_check.h>

namespace rtsg {

namespace {

namespace fs = std::filesystem;

/// True if the file's name is `pattern`, which has a place for a number such as %04d, with some number.
bool isOneOf(const fs::path& file, const fs::path& pattern) {
    const std::string name = file.filename().string();
    std::error_code error;
    if (!numberedName(pattern.filename().string(), 0) ||
        !fs::equivalent(file.parent_path(), pattern.has_parent_path() ? pattern.parent_path() : ".", error))
        return false;
    for (std::size_t i = 0; i < name.size(); ++i) {
        int number = 0;
        if (std::from_chars(name.data() + i, name.data() + name.size(), number).ec == std::errc() &&
            numberedName(pattern.filename().string(), number) == name)
            return true;
    }
    return false;
}

}  // namespace

/// False for empty names, "-", and irregular files, which cannot be overwritten.
bool isOutputFile(const std::string& name) {
    if (name.empty() || name == "-") return false;
    std::error_code error;
    const fs::file_status status = fs::status(name, error);
    return !fs::exists(status) || fs::is_regular_file(status);
}

Result<> checkUnused(const std::vector<fs::path>& used, const std::vector<OutputName>& outputs) {
    for (const fs::path& file : used)
        for (const OutputName& output : outputs)
            if (isOutputFile(output.file) && (sameFile(file, output.file) || isOneOf(file, output.file)))
                return fail(kUsageCode, fmt::format("{}: the scene uses {}", output.option, file.string()));
    return {};
}

Result<> checkUnused(const Scene& scene, const Resources& resources, const std::vector<OutputName>& outputs) {
    if (std::ranges::none_of(outputs, [](const OutputName& output) { return isOutputFile(output.file); })) return {};
    return checkUnused(resourceFiles(scene, resources), outputs);
}

bool OutputOptions::soundInFilm() const {
    return MovieWriter::isName(listen) && !render.empty() && sameFile(listen, render);
}

bool OutputOptions::animated() const {
    return PictureFiles(render, picturesPerSecond).takesSeveral();
}

OutputOptions::SoundStretch OutputOptions::stretch() const {
    const double rate = hearing.render.sampleRate;
    const double first = static_cast<double>(only->first) / picturesPerSecond;
    // Rooms in which something moves all the time are then traced at the same moments as in a run of all.
    const auto block = static_cast<double>(hearing.render.blockSize);
    const double step = block * std::ceil(hearing.render.retraceSeconds * rate / block);
    const double before = std::max(0.0, std::floor((first - runUp) * rate / step)) * step;
    return {std::llround(before), std::llround(first * rate),
            std::llround(static_cast<double>(only->last + 1) / picturesPerSecond * rate)};
}

std::vector<OutputName> OutputOptions::names() const {
    return {{"--render", render, OutputKind::picture},
            {"--listen", onDevice() || soundInFilm() ? std::string() : listen, OutputKind::sound},
            {"--record", record, OutputKind::log},
            {"--save", save, OutputKind::scene}};
}

std::string OutputOptions::written() const {
    std::string files;
    for (const OutputName& output : names())
        if (!output.file.empty()) files += (files.empty() ? "" : ", ") + output.file;
    return files;
}

Result<> OutputOptions::leftUnwritten() const {
    const PictureFiles pictures(render, picturesPerSecond);
    std::string files;
    for (const OutputName& output : names()) {
        const bool numbered = output.kind == OutputKind::picture && pictures.takesSeveral() && !pictures.together();
        if (output.file.empty() || output.kind == OutputKind::log || numbered) continue;
        files += (files.empty() ? "" : ", ") + output.file;
    }
    if (files.empty()) return {};
    return fail("interrupted before its end: not written", {}, files);
}

}  // namespace rtsg
