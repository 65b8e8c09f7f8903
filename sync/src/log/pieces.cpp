// Finds the pieces of a rotated log by name, and tells from their content whether they are pieces.
#include "log_files.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstring>
#include <fstream>
#include <iterator>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>

#include <fmt/format.h>

#include <rtsg/sync/log.h>

#include "index.h"

namespace rtsg {

std::vector<std::pair<std::uint64_t, std::filesystem::path>> numberedPieces(const std::filesystem::path& file) {
    const std::string before = file.stem().string() + ".", after = file.extension().string();
    std::vector<std::pair<std::uint64_t, std::filesystem::path>> found;
    std::error_code error;
    for (const auto& entry :
         std::filesystem::directory_iterator(file.has_parent_path() ? file.parent_path() : ".", error)) {
        const std::string name = entry.path().filename().string();
        if (!name.starts_with(before) || !name.ends_with(after) || name.size() < before.size() + after.size() + 4)
            continue;
        const char *const first = name.data() + before.size(), *const last = name.data() + name.size() - after.size();
        std::uint64_t number = 0;
        if (const auto [end, problem] = std::from_chars(first, last, number); problem != std::errc() || end != last)
            continue;
        // The name must be one that the writer gives; RUN.20261128.rlog is somebody's copy.
        if (number >= kMaxPieces || fmt::format("{:04}", number) != std::string_view(first, last)) continue;
        found.emplace_back(number, file.has_parent_path() ? entry.path() : entry.path().filename());
    }
    std::ranges::sort(found);
    return found;
}

namespace {

/// The name of the log to which a file of such a name belongs: "a" for a.rlog and for a.0001.rlog.
std::string logOf(const std::filesystem::path& file) {
    const std::string stem = file.stem().string(), ending = file.stem().extension().string();
    const std::string_view digits = std::string_view(ending).substr(ending.empty() ? 0 : 1);
    std::uint64_t number = 0;
    const auto [end, problem] = std::from_chars(digits.data(), digits.data() + digits.size(), number);
    const bool isPiece = problem == std::errc() && end == digits.data() + digits.size() && number < kMaxPieces &&
                         fmt::format("{:04}", number) == digits;
    return isPiece ? file.stem().stem().string() : stem;
}

}  // namespace

Result<std::vector<std::filesystem::path>> filesOfLog(const std::filesystem::path& name) {
    std::error_code error;
    if (!std::filesystem::is_directory(name, error)) {
        std::vector<std::filesystem::path> files;
        const std::string text = name.string();
        if (!text.contains(',') || std::filesystem::exists(name, error)) return std::vector{name};
        for (std::size_t from = 0; from <= text.size();) {
            const std::size_t comma = std::min(text.find(',', from), text.size());
            if (comma > from) files.emplace_back(text.substr(from, comma - from));
            from = comma + 1;
        }
        if (files.empty()) return std::vector{name};
        return files;
    }
    std::set<std::string> logs;
    for (const auto& entry : std::filesystem::directory_iterator(name, error))
        if (entry.path().extension() == ".rlog") logs.insert(logOf(entry.path().filename()));
    if (error) return fail("cannot read: " + error.message(), {}, name.string());
    if (logs.empty()) return fail("there is no log in this folder", {}, name.string());
    if (logs.size() > 1)
        return fail(fmt::format("there are several logs in this folder, such as {} and {}: name one, or its files by "
                                "commas",
                                *logs.begin(), *std::next(logs.begin())),
                    {}, name.string());
    const std::filesystem::path newest = name / (*logs.begin() + ".rlog");
    std::vector<std::filesystem::path> files = earlierPieces(newest);
    if (std::filesystem::exists(newest, error)) files.push_back(newest);
    return files;
}

std::vector<std::filesystem::path> earlierPieces(const std::filesystem::path& file) {
    std::vector<std::filesystem::path> pieces;
    for (auto& [number, piece] : numberedPieces(file)) pieces.push_back(std::move(piece));
    return pieces;
}

std::filesystem::path laterPiece(const std::filesystem::path& piece) {
    const std::filesystem::path log = piece.parent_path() / (piece.stem().stem().string() + piece.extension().string());
    if (log == piece || !std::filesystem::exists(log)) return {};
    return std::ranges::count(earlierPieces(log), piece) > 0 ? log : std::filesystem::path();
}

namespace {

/// The marks by which a file names its session.
struct Marks {
    std::optional<StreamHead> head;
    std::optional<RecordHeader> first;  // of its first keyframe, if that follows the head
    std::optional<RecordHeader> next;   // of its index, if a later piece begins with that state
};

/// Reads the record at `offset` if it is intact. Reads no further, as there may be thousands of files.
std::optional<RecordHeader> readRecord(std::ifstream& in, std::uint64_t offset, ByteBuffer& record) {
    constexpr std::uint64_t kMax = std::uint64_t{16} << 20;
    const auto append = [&](std::size_t length) {
        in.read(reinterpret_cast<char*>(record.room(length)), static_cast<std::streamsize>(length));
        if (in) record.advance(length);
        return bool(in);
    };
    record.clear();
    if (!in.seekg(static_cast<std::streamoff>(offset)) || !append(kRecordHeaderSize)) return std::nullopt;
    const auto header = parseRecordHeader(record.bytes(), offset, kMax);
    if (!header || !append(header->length) || !checkRecord(record.bytes(), offset, kMax)) return std::nullopt;
    return *header;
}

/// Reads the header of the record at `offset` alone.
std::optional<RecordHeader> readHeader(std::ifstream& in, std::uint64_t offset) {
    std::array<std::byte, kRecordHeaderSize> bytes{};
    in.seekg(static_cast<std::streamoff>(offset));
    in.read(reinterpret_cast<char*>(bytes.data()), bytes.size());
    const bool whole = bool(in);
    in.clear();
    const auto header = whole ? parseRecordHeader(bytes) : Result<RecordHeader>(fail(""));
    return header ? std::optional(*header) : std::nullopt;
}

/// True for regular files. Opening others, such as pipes, might block.
bool isFile(const std::filesystem::path& path) {
    std::error_code error;
    return std::filesystem::is_regular_file(path, error);
}

Marks marksOf(const std::filesystem::path& file) {
    Marks marks;
    if (!isFile(file)) return marks;
    std::ifstream in(file, std::ios::binary);
    ByteBuffer record;
    const auto first = readRecord(in, 0, record);
    if (!first || first->kind != RecordKind::head) return marks;
    if (const auto head = decodeHead(record.bytes())) marks.head = *head;
    // The head stands there twice.
    std::uint64_t behind = first->size();
    auto second = readHeader(in, behind);
    if (second && second->kind == RecordKind::head) second = readHeader(in, behind += second->size());
    if (second && second->kind == RecordKind::keyframe) marks.first = *second;
    char tail[kIndexTail];
    if (!in.seekg(-static_cast<std::streamoff>(kIndexTail), std::ios::end) || !in.read(tail, kIndexTail) ||
        std::string_view(tail + sizeof(std::uint64_t), kIndexMagic.size()) != kIndexMagic)
        return marks;
    std::uint64_t offset = 0;
    std::memcpy(&offset, tail, sizeof(offset));
    const auto last = readRecord(in, offset, record);
    if (last && saysGoesOn(*last)) marks.next = *last;
    return marks;
}

}  // namespace

std::vector<std::filesystem::path> recordedPieces(const std::filesystem::path& file) {
    std::vector<std::pair<std::filesystem::path, std::uint64_t>> found;
    std::set<std::uint64_t> rotated;  // epochs of rotated sessions
    const auto look = [&](const std::filesystem::path& path) -> std::optional<std::uint64_t> {
        const Marks marks = marksOf(path);
        if (!marks.head) return std::nullopt;
        if (marks.next || marks.head->start) rotated.insert(marks.head->epoch);
        return marks.head->epoch;
    };
    look(file);
    for (const std::filesystem::path& piece : earlierPieces(file))
        if (const auto epoch = look(piece)) found.emplace_back(piece, *epoch);
    std::vector<std::filesystem::path> pieces;
    for (auto& [piece, epoch] : found)
        if (rotated.contains(epoch)) pieces.push_back(std::move(piece));
    return pieces;
}

std::vector<std::string> gapsBetweenFiles(const std::filesystem::path& name) {
    std::vector<std::string> gaps;
    const auto files = filesOfLog(name);
    if (!files) return gaps;
    for (std::size_t i = 1; i < files->size(); ++i) {
        const std::filesystem::path &earlier = (*files)[i - 1], &later = (*files)[i];
        const Marks before = marksOf(earlier), after = marksOf(later);
        if (!before.next || !before.head || !after.head) continue;
        const std::string between =
            fmt::format("between {} and {}", earlier.filename().string(), later.filename().string());
        if (before.head->epoch != after.head->epoch)
            gaps.push_back(
                fmt::format("{} the end of a session is missing, from state {} on", between, before.next->to + 1));
        else if (after.first && after.first->to > before.next->to)
            gaps.push_back(fmt::format("{} frames {} to {} are missing, {:.6g} s", between, before.next->to + 1,
                                       after.first->to, after.first->time - before.next->time));
    }
    return gaps;
}

std::optional<StreamHead> headOf(const std::filesystem::path& file) {
    return marksOf(file).head;
}

bool isCutInHead(const std::filesystem::path& file) {
    if (!isFile(file)) return false;
    std::ifstream in(file, std::ios::binary | std::ios::ate);
    if (!in) return false;
    const auto size = static_cast<std::uint64_t>(in.tellg());
    std::string bytes(std::min<std::uint64_t>(size, kRecordHeaderSize), '\0');
    if (!in.seekg(0) || !in.read(bytes.data(), static_cast<std::streamsize>(bytes.size()))) return false;
    if (size < kRecordHeaderSize) return bytes.starts_with(kRecordMagic) || kRecordMagic.starts_with(bytes);
    const auto header = parseRecordHeader(std::as_bytes(std::span(bytes)));
    if (!header || header->kind != RecordKind::head || header->size() <= size) return false;
    // If other records follow, the file is a log whose first bytes are damaged.
    return !LogReader::open(file);
}

std::filesystem::path pieceBefore(const std::filesystem::path& log) {
    const auto pieces = recordedPieces(log);
    if (pieces.empty()) return {};
    const auto head = headOf(log);
    if (!head) return isCutInHead(log) ? pieces.back() : std::filesystem::path();
    const auto before = headOf(pieces.back());
    return head->start && before && before->epoch == head->epoch ? pieces.back() : std::filesystem::path();
}

}  // namespace rtsg
