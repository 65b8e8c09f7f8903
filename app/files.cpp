// The checks of the names that a verb reads from and writes to.
#include "files.h"

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <fstream>
#include <initializer_list>

#include <fmt/format.h>

#include <rtsg/audio/sound_file.h>
#include <rtsg/core/terminal.h>
#include <rtsg/documents/resource_check.h>
#include <rtsg/documents/writer.h>
#include <rtsg/renderers/image.h>
#include <rtsg/renderers/mesh_file.h>
#include <rtsg/renderers/picture.h>
#include <rtsg/sync/log.h>
#include <rtsg/sync/log_summary.h>

namespace rtsg::app {

namespace {

namespace fs = std::filesystem;

/// Empty names and "-" are none, and what is no regular file cannot be overwritten.
bool isFile(const std::string& name) {
    if (name.empty() || name == "-") return false;
    std::error_code error;
    const fs::file_status status = fs::status(name, error);
    return !fs::exists(status) || fs::is_regular_file(status);
}

/// Whether the file has the name `pattern`, which has a place for a number such as %04d, with one of the numbers.
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

void checkName(const OutputName& output) {
    const auto refuse = [&](const Diagnostic& why) { throw UsageError(output.option, output.file + ": " + why.text); };
    MeshFormat mesh{};
    Encoding encoding{};
    bool gzip = false;
    switch (output.kind) {
        case OutputKind::picture:
            if (PictureFiles(output.file, 1).together()) break;
            if (auto ok = checkPictureName(output.file); !ok) refuse(ok.error());
            break;
        case OutputKind::sound:
            if (auto ok = checkSoundName(output.file); !ok) refuse(ok.error());
            break;
        case OutputKind::scene:
            // The binary encoding and other programs' meshes are convert's alone.
            if (output.option == "OUT" &&
                (fs::path(output.file).extension() == ".rtsgb" || meshFormatFromName(output.file, mesh)))
                break;
            if (output.file != "-" && !encodingFromName(output.file, encoding, gzip))
                throw UsageError(
                    output.option,
                    output.file +
                        ": no kind of scene that can be written has such a name; there are: .x3d .x3dv .wrl .json, "
                        "each also with .gz" +
                        (output.option == "OUT" ? "; .rtsgb; .stl .obj .ply .glb" : ""));
            break;
        case OutputKind::log:
        case OutputKind::report:
            break;
    }
}

std::string beginOf(const std::string& file) {
    std::ifstream in(file, std::ios::binary);
    std::string begin(4096, '\0');
    in.read(begin.data(), static_cast<std::streamsize>(begin.size()));
    begin.resize(static_cast<std::size_t>(in.gcount()));
    return begin;
}

/// Whether the file is a log, ours or one that --export writes, whole or damaged, or is empty.
bool isLogToReplace(const std::string& file) {
    const std::string begin = beginOf(file);
    return begin.empty() || begin.starts_with("\x89MCAP") || fs::path(file).extension() == ".mcap" ||
           isLogOrNamedSo(file);
}

/// Texts have no zero bytes; sounds, pictures and most other files have. A SOFA file may be replaced by another.
bool isBinary(const std::string& file) {
    return fs::path(file).extension() != ".sofa" && beginOf(file).contains('\0');
}

/// By its name or by how it begins: a name that was meant for another option.
bool isSceneOrLog(const std::string& file) {
    Encoding encoding{};
    bool gzip = false;
    if (encodingFromName(file, encoding, gzip) && fs::path(file).extension() != ".json") return true;
    const std::string begin = beginOf(file);
    if (begin.starts_with(kRecordMagic) || begin.starts_with("glTF")) return true;
    return std::ranges::any_of(std::initializer_list<std::string_view>{"#X3D", "#VRML", "<X3D", "\"X3D\""},
                               [&](std::string_view sign) { return begin.contains(sign); });
}

}  // namespace

void addForce(Command& command, bool& force) {
    command.addFlag("--force", force, "replace a log or scene that is there already");
}

Result<> checkFiles(const std::vector<std::string>& inputs, const std::vector<OutputName>& outputs, bool force) {
    for (std::size_t i = 0; i < outputs.size(); ++i) {
        const OutputName& output = outputs[i];
        if (output.file.empty()) continue;
        checkName(output);
        if (!isFile(output.file)) continue;
        for (const std::string& input : inputs)
            if (isFile(input) && sameFile(input, output.file))
                throw UsageError(output.option,
                                 fmt::format("{} is {}", output.file,
                                             output.file == input ? "the input itself" : "the input " + input));
        for (std::size_t k = 0; k < i; ++k)
            if (isFile(outputs[k].file) && sameFile(outputs[k].file, output.file))
                throw UsageError(output.option, fmt::format("{} is what {} writes", output.file, outputs[k].option));
    }
    for (const OutputName& output : outputs) {
        std::error_code error;
        if (!isFile(output.file) || !fs::exists(output.file, error)) continue;
        // A sound or a picture of a scene, say, which no log knows before it is played.
        if (output.kind == OutputKind::log && !isLogToReplace(output.file))
            return fail(output.option + " takes the place of logs only", {}, output.file);
        if (force) continue;
        if (output.kind == OutputKind::scene || output.kind == OutputKind::log)
            return fail("there is a file already; --force replaces it", {}, output.file);
        if (output.kind == OutputKind::report && isSceneOrLog(output.file))
            return fail(output.option + " takes the place of no scene or log", {}, output.file);
        if (output.kind == OutputKind::report && isBinary(output.file))
            return fail(output.option + " takes the place of no binary file", {}, output.file);
    }
    return {};
}

void keepFiles(const std::vector<fs::path>& used, const std::vector<OutputName>& outputs) {
    for (const fs::path& file : used)
        for (const OutputName& output : outputs)
            if (isFile(output.file) && (sameFile(file, output.file) || isOneOf(file, output.file)))
                throw UsageError(output.option, fmt::format("the scene uses {}", file.string()));
}

void keepResources(const Scene& scene, const Resources& resources, const std::vector<OutputName>& outputs) {
    if (std::ranges::any_of(outputs, [](const OutputName& output) { return isFile(output.file); }))
        keepFiles(resourceFiles(scene, resources), outputs);
}

bool isLogOrNamedSo(const std::string& file) {
    return isLog(file) || fs::path(file).extension() == ".rlog";
}

/// A log that says that its session begins with it has none before it, whatever lies beside it.
static bool beginsItsSession(const std::string& log) {
    auto reader = LogReader::open(log);
    const auto record = reader ? reader->next() : std::nullopt;
    if (!record || record->header.kind != RecordKind::head) return false;
    const auto head = decodeHead(record->bytes);
    return head && !head->start;
}

void tellOfEarlierPieces(const std::string& log) {
    const std::vector<std::filesystem::path> pieces = earlierPieces(log);
    if (pieces.empty() || beginsItsSession(log)) return;
    fmt::print(stderr, "{}: note: the last piece of a log; {} before it: {}{}\n", terminalText(log), pieces.size(),
               terminalText(pieces.front().string()),
               pieces.size() > 1 ? " to " + terminalText(pieces.back().string()) : "");
    const std::string extension = std::filesystem::path(log).extension().string();
    const std::string name = terminalText(std::filesystem::path(log).replace_extension().string());
    // In this order whatever the shell sorts by: from the ten thousandth on they have a digit more.
    constexpr std::size_t kDigits = 4;
    const std::size_t longest = pieces.back().stem().extension().string().size() - 1;
    std::string all;
    for (std::size_t digits = kDigits; digits <= longest; ++digits)
        all += fmt::format("{}.{}{} ", name, std::string(digits, '?'), extension);
    fmt::print(stderr, "  to have it as one: cat {}{} > all{}\n", all, terminalText(log), extension);
}

}  // namespace rtsg::app
