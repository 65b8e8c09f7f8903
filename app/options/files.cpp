// Checks the names of files that a verb reads and writes.
#include "files.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <string_view>

#include <fmt/format.h>

#include <rtsg/audio/sound_file.h>
#include <rtsg/core/terminal.h>
#include <rtsg/documents/writer.h>
#include <rtsg/renderers/image.h>
#include <rtsg/renderers/mesh_file.h>
#include <rtsg/renderers/picture.h>
#include <rtsg/sync/log.h>
#include <rtsg/sync/log_summary.h>

#include "cli.h"
#include "extensions.h"
#include "say.h"

namespace rtsg::app {

namespace {

namespace fs = std::filesystem;

/// True for pipes, devices and the like.
bool isOfNoKind(const std::string& name) {
    std::error_code error;
    const fs::file_status status = fs::status(name, error);
    return fs::exists(status) && !fs::is_regular_file(status) && !fs::is_directory(status);
}

/// The name endings of file kinds. Empty endings: a library checks them.
struct Names {
    std::string_view plural;
    std::vector<std::string_view> endings;
};
Names namesOf(OutputKind kind) {
    switch (kind) {
        case OutputKind::response:
            return {"responses", {".wav", ".sofa"}};
        case OutputKind::log:
            return {"logs", {".rlog"}};
        case OutputKind::ticks:
            return {"ticks", {".csv", ".svg"}};
        case OutputKind::capture:
            return {"MCAP files", {".mcap"}};
        case OutputKind::report:
            return {"reports", {".html", ".json", ".txt"}};
        case OutputKind::map:
            return {"maps", {".png", ".csv"}};
        case OutputKind::page:
            return {"pages", {".html", ".htm"}};
        case OutputKind::testResult:
            return {"JUnit's results", {".xml"}};
        case OutputKind::table:
            return {"tables", {".csv"}};
        case OutputKind::picture:
        case OutputKind::sound:
        case OutputKind::scene:
            break;
    }
    return {};
}

/// Joins the words: ".a, .b or .c".
std::string either(const std::vector<std::string_view>& words) {
    std::string text(words.front());
    for (std::size_t i = 1; i < words.size(); ++i)
        text += fmt::format("{}{}", i + 1 < words.size() ? ", " : " or ", words[i]);
    return text;
}

/// Only convert writes other programs' meshes, and standard output.
void checkSceneName(const OutputName& output) {
    const bool isOfConvert = output.option == "OUT";
    MeshFormat mesh{};
    if (fs::path(output.file).extension() == ".rtsgb") return;
    if (isOfConvert && (output.file == "-" || meshFormatFromName(output.file, mesh))) return;
    if (checkDocumentName(output.file, extensions().dialect().get())) return;
    throw UsageError(
        output.option,
        fmt::format("{}: no kind of scene that can be written has such a name; there are: .x3d .x3dv .wrl .json, "
                    "each also with .gz; .rtsgb{}",
                    output.file, isOfConvert ? "; .stl .obj .ply .glb" : ""));
}

void checkName(const OutputName& output) {
    const auto check = [&](const Result<>& ok) {
        if (!ok) throw UsageError(output.option, output.file + ": " + ok.error().text);
    };
    if (output.kind == OutputKind::scene) return checkSceneName(output);
    if (output.kind == OutputKind::sound) return check(checkSoundName(output.file));
    if (output.kind == OutputKind::picture) {
        if (!PictureFiles(output.file, 1).together()) check(checkPictureName(output.file));
        return;
    }
    const Names names = namesOf(output.kind);
    const std::string ending = fs::path(output.file).extension().string();
    if (std::ranges::find(names.endings, ending) == names.endings.end() && !isOfNoKind(output.file))
        throw UsageError(output.option, fmt::format("{}: {} are {}", output.file, names.plural, either(names.endings)));
}

std::string beginOf(const std::string& file) {
    std::ifstream in(file, std::ios::binary);
    std::string begin(4096, '\0');
    in.read(begin.data(), static_cast<std::streamsize>(begin.size()));
    begin.resize(static_cast<std::size_t>(in.gcount()));
    return begin;
}

/// True for files that are made again and again and hold nothing of their own. A response as WAV counts as a sound.
bool isReport(const OutputName& output) {
    return output.kind == OutputKind::report || output.kind == OutputKind::page ||
           output.kind == OutputKind::testResult || output.kind == OutputKind::table ||
           (output.kind == OutputKind::map && fs::path(output.file).extension() == ".csv") ||
           (output.kind == OutputKind::response && fs::path(output.file).extension() == ".sofa");
}

/// Most files other than texts have zero bytes. A SOFA file may be replaced by another one.
bool isBinary(const std::string& file) {
    return fs::path(file).extension() != ".sofa" && beginOf(file).contains('\0');
}

/// True by name or by content: such a name was probably meant for another option.
bool isSceneOrLog(const std::string& file) {
    Encoding encoding{};
    bool gzip = false;
    if (encodingFromName(file, encoding, gzip) && fs::path(file).extension() != ".json") return true;
    const std::string begin = beginOf(file);
    if (begin.starts_with(kRecordMagic) || begin.starts_with("glTF")) return true;
    return std::ranges::any_of(std::initializer_list<std::string_view>{"#X3D", "#VRML", "<X3D", "\"X3D\""},
                               [&](std::string_view sign) { return begin.contains(sign); });
}

/// Logs may lie in several files.
std::vector<std::string> filesOf(const std::vector<std::string>& inputs) {
    std::vector<std::string> all;
    for (const std::string& input : inputs) {
        const auto files = filesOfLog(input);
        if (!files) continue;
        for (const fs::path& file : *files) all.push_back(file.string());
    }
    return all;
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
        if (!isOutputFile(output.file)) continue;
        for (const std::string& input : filesOf(inputs))
            if (isOutputFile(input) && sameFile(input, output.file))
                throw UsageError(output.option,
                                 fmt::format("{} is {}", output.file,
                                             output.file == input ? "the input itself" : "the input " + input));
        for (std::size_t k = 0; k < i; ++k)
            if (isOutputFile(outputs[k].file) && sameFile(outputs[k].file, output.file))
                throw UsageError(output.option, fmt::format("{} is what {} writes", output.file, outputs[k].option));
    }
    for (const OutputName& output : outputs) {
        std::error_code error;
        if (!isOutputFile(output.file) || !fs::exists(output.file, error)) continue;
        if (force) continue;
        const bool isLog = output.kind == OutputKind::log || output.kind == OutputKind::capture;
        if (output.kind == OutputKind::scene || isLog)
            return fail("there is a file already; --force replaces it", {}, output.file);
        if (isReport(output) && isSceneOrLog(output.file))
            return fail(output.option + " takes the place of no scene or log", {}, output.file);
        if (isReport(output) && isBinary(output.file))
            return fail(output.option + " takes the place of no binary file", {}, output.file);
    }
    return {};
}

void keepFiles(const std::vector<fs::path>& used, const std::vector<OutputName>& outputs) {
    orUsageError(checkUnused(used, outputs));
}

void keepResources(const Scene& scene, const Resources& resources, const std::vector<OutputName>& outputs) {
    orUsageError(checkUnused(scene, resources, outputs));
}

bool isLogOrNamedSo(const std::string& file) {
    std::error_code error;
    return isLog(file) || fs::path(file).extension() == ".rlog" || fs::is_directory(file, error);
}

std::string firstFileOf(const std::string& log) {
    const auto files = filesOfLog(log);
    return files ? files->front().string() : log;
}

/// True if a log begins with its session, so that files beside it are not earlier pieces.
static bool beginsItsSession(const std::string& log) {
    auto reader = LogReader::open(log);
    const auto record = reader ? reader->next() : std::nullopt;
    if (!record || record->header.kind != RecordKind::head) return false;
    const auto head = decodeHead(record->bytes);
    return head && !head->start;
}

/// The argument that names the pieces and the log as one.
static std::string asOne(const std::string& log, const std::vector<fs::path>& pieces) {
    constexpr std::size_t kFewPieces = 3;
    const fs::path folder = fs::path(log).parent_path();
    const auto all = filesOfLog(folder.empty() ? "." : folder);
    if (all && all->size() == pieces.size() + 1) return folder.empty() ? "." : folder.string();
    if (pieces.size() > kFewPieces) return {};
    std::string list;
    for (const fs::path& piece : pieces) list += piece.string() + ",";
    return list + log;
}

void reportOfPieces(const std::string& log) {
    for (const std::string& gap : gapsBetweenFiles(log))
        reportError("{}: warning: {}\n", terminalText(log), terminalText(gap));
    if (!isOutputFile(log)) return;
    const std::vector<std::filesystem::path> pieces = earlierPieces(log);
    if (pieces.empty() || beginsItsSession(log)) return;
    reportError("{}: note: the last piece of a log; {} before it: {}{}\n", terminalText(log), pieces.size(),
                terminalText(pieces.front().string()),
                pieces.size() > 1 ? " to " + terminalText(pieces.back().string()) : "");
    if (const std::string all = asOne(log, pieces); !all.empty()) {
        reportError("  to have it as one: {}\n", terminalText(all));
        return;
    }
    const std::string extension = std::filesystem::path(log).extension().string();
    const std::string name = terminalText(std::filesystem::path(log).replace_extension().string());
    // One pattern for each number of digits (five from the ten thousandth piece on), so the shell keeps the order.
    constexpr std::size_t kDigits = 4;
    const std::size_t longest = pieces.back().stem().extension().string().size() - 1;
    std::string all;
    for (std::size_t digits = kDigits; digits <= longest; ++digits)
        all += fmt::format("{}.{}{} ", name, std::string(digits, '?'), extension);
    reportError("  to have it as one: cat {}{} > all{}\n", all, terminalText(log), extension);
}

}  // namespace rtsg::app
