// Finds the pieces of a rotated log by name, and tells from their content whether they are pieces.
#include "pieces.h"

#include <algorithm>
#include <charconv>
#include <cstring>
#include <fstream>
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
        if (number >= kMostPieces || fmt::format("{:04}", number) != std::string_view(first, last)) continue;
        found.emplace_back(number, file.has_parent_path() ? entry.path() : entry.path().filename());
    }
    std::ranges::sort(found);
    return found;
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

/// What a file says of the session to which it belongs.
struct Marks {
    std::optional<StreamHead> head;
    bool goesOn = false;
};

/// Reads the record at `offset` if it is intact. Reads no further, as there may be thousands of files.
std::optional<RecordHeader> readRecord(std::ifstream& in, std::uint64_t offset, ByteBuffer& record) {
    constexpr std::uint64_t kMost = std::uint64_t{16} << 20;
    const auto append = [&](std::size_t length) {
        in.read(reinterpret_cast<char*>(record.room(length)), static_cast<std::streamsize>(length));
        if (in) record.advance(length);
        return bool(in);
    };
    record.clear();
    if (!in.seekg(static_cast<std::streamoff>(offset)) || !append(kRecordHeaderSize)) return std::nullopt;
    const auto header = parseRecordHeader(record.bytes(), offset, kMost);
    if (!header || !append(header->length) || !checkRecord(record.bytes(), offset, kMost)) return std::nullopt;
    return *header;
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
    char tail[kIndexTail];
    if (!in.seekg(-static_cast<std::streamoff>(kIndexTail), std::ios::end) || !in.read(tail, kIndexTail) ||
        std::string_view(tail + sizeof(std::uint64_t), kIndexMagic.size()) != kIndexMagic)
        return marks;
    std::uint64_t offset = 0;
    std::memcpy(&offset, tail, sizeof(offset));
    const auto last = readRecord(in, offset, record);
    marks.goesOn = last && saysGoesOn(*last);
    return marks;
}

}  // namespace

std::vector<std::filesystem::path> recordedPieces(const std::filesystem::path& file) {
    std::vector<std::pair<std::filesystem::path, std::uint64_t>> found;
    std::set<std::uint64_t> rotated;  // epochs of rotated sessions
    const auto look = [&](const std::filesystem::path& path) -> std::optional<std::uint64_t> {
        const Marks marks = marksOf(path);
        if (!marks.head) return std::nullopt;
        if (marks.goesOn || marks.head->start) rotated.insert(marks.head->epoch);
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
