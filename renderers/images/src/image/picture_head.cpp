// Reads the heads of picture files as far as they say how much memory a reader would take, and judges that by the
// file's size.
#include "picture_head.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <utility>

#include <fmt/format.h>

#include "exr_head.h"
#include "head_bytes.h"

namespace rtsg {

namespace {

// The most bytes of pixels that one byte of a file can stand for, by compression.
constexpr std::uint64_t kDeflate = 1032;      // 258 bytes of two bits
constexpr std::uint64_t kLzw = 4096;          // an entry of a full table, of twelve bits
constexpr std::uint64_t kRuns = 128;          // a run of 255 takes two bytes
constexpr std::uint64_t kArithmetic = 32768;  // of coders that spend a small part of a bit on expected values

/// For a file whose head is longer than any writer makes it.
constexpr HeadSize kUnknown{kLargestSide, kLargestSide, kLargestSide, 8, 1};

/// The segments of a JPEG file, each of which states its length; coded data follow those that begin a scan.
class JpegSegments {
  public:
    explicit JpegSegments(const HeadBytes& file) : file_(&file) {}
    /// False at the end, and where the file is damaged.
    bool next() {
        if (marker_ == kScan) {
            at_ = behindScan(at_ + 2 + file_->big(at_ + 2, 2));
        } else if (marker_ != 0) {
            const bool isAlone = marker_ == 0x01 || (marker_ >= 0xD0 && marker_ <= 0xD8);
            at_ += isAlone ? 2 : 2 + file_->big(at_ + 2, 2);
        }
        while (file_->byte(at_) == 0xFF && file_->byte(at_ + 1) == 0xFF) ++at_;  // fill bytes
        marker_ = file_->byte(at_ + 1);
        constexpr unsigned kEnd = 0xD9;
        return at_ + 1 < file_->size() && file_->byte(at_) == 0xFF && marker_ != kEnd;
    }
    std::uint64_t at() const { return at_; }
    unsigned marker() const { return marker_; }
    bool isFrame() const {
        return marker_ >= 0xC0 && marker_ <= 0xCF && marker_ != 0xC4 && marker_ != 0xC8 && marker_ != 0xCC;
    }
    bool isScan() const { return marker_ == kScan; }

  private:
    /// In a scan 0xFF stands before a zero, or a mark of a place to begin anew.
    std::uint64_t behindScan(std::uint64_t at) const {
        constexpr std::size_t kBlock = 1 << 16;
        while (at < file_->size()) {
            const std::string block = file_->text(at, kBlock);
            const std::size_t found = block.find('\xFF');
            if (block.empty()) return file_->size();
            if (found == std::string::npos) {
                at += block.size();
                continue;
            }
            const unsigned marker = file_->byte(at + found + 1);
            if (marker != 0 && (marker < 0xD0 || marker > 0xD7)) return at + found;
            at += found + 2;
        }
        return at;
    }

    static constexpr unsigned kScan = 0xDA;
    const HeadBytes* file_;
    std::uint64_t at_ = 2;
    unsigned marker_ = 0;
};

std::optional<HeadSize> jpegSize(const HeadBytes& file) {
    constexpr int kMaxSegments = 10'000;
    JpegSegments segments(file);
    for (int i = 0; segments.next() && !segments.isScan(); ++i) {
        if (i == kMaxSegments) return kUnknown;
        if (!segments.isFrame()) continue;
        const std::uint64_t at = segments.at();
        // The first scan spends a bit on each block of 8 x 8, of each colour; an arithmetic coder spends less.
        const std::uint64_t colours = std::max(file.byte(at + 9), 1u);
        const std::uint64_t maximum = segments.marker() >= 0xC9 ? kArithmetic : 8 * 64;
        return HeadSize{file.big(at + 7, 2), file.big(at + 5, 2), 1, 8 * colours, maximum * colours};
    }
    return std::nullopt;
}

/// Each scan goes over the whole picture, however short it is.
std::string whyJpegHasTooManyScans(const HeadBytes& file) {
    constexpr int kMaxScans = 100;  // ten are usual
    JpegSegments segments(file);
    for (int scans = 0; segments.next();)
        if (segments.isScan() && ++scans > kMaxScans)
            return fmt::format("the JPEG file goes over its picture more than {} times", kMaxScans);
    return {};
}

HeadSize pngSize(const HeadBytes& file) {
    constexpr unsigned kChannels[] = {1, 1, 3, 1, 2, 1, 4, 1};  // by the kind of colours
    return {file.big(16, 4), file.big(20, 4), 1, std::uint64_t{file.byte(24)} * kChannels[file.byte(25) & 7u],
            kDeflate};
}

HeadSize bmpSize(const HeadBytes& file) {
    const bool isOld = file.little(14, 4) == 12;
    const auto height = static_cast<std::int32_t>(isOld ? file.little(20, 2) : file.little(22, 4));
    const std::uint64_t width = isOld ? file.little(18, 2) : file.little(18, 4);
    const std::uint64_t bits = isOld ? file.little(24, 2) : file.little(28, 2);
    const std::uint64_t packing = isOld ? 0 : file.little(30, 4);
    const bool isRuns = packing == 1 || packing == 2;
    return {width, static_cast<std::uint64_t>(height < 0 ? -std::int64_t{height} : height), 1, bits,
            isRuns ? kRuns : 1};
}

HeadSize tgaSize(const HeadBytes& file) {
    return {file.little(12, 2), file.little(14, 2), 1, file.byte(16), (file.byte(2) & 8u) != 0 ? kRuns : 1};
}

HeadSize ddsSize(const HeadBytes& file) {
    constexpr std::uint64_t kBlocks = 4, kBitsOfRgb = 32;
    const std::uint64_t depth = std::max<std::uint64_t>(file.little(24, 4), 1);
    // The smallest block has half a byte for each pixel.
    const bool isBlocks = (file.little(80, 4) & kBlocks) != 0;
    return {file.little(16, 4), file.little(12, 4), depth,
            isBlocks ? 4 : std::clamp<std::uint64_t>(file.little(88, 4), 1, 4 * kBitsOfRgb), 1};
}

std::optional<HeadSize> webpSize(const HeadBytes& file) {
    const std::string kind = file.text(12, 4);
    constexpr std::uint64_t kBits = 32;
    if (kind == "VP8X") return HeadSize{file.little(24, 3) + 1, file.little(27, 3) + 1, 1, kBits, kArithmetic};
    if (kind == "VP8 ")
        return HeadSize{file.little(26, 2) & 0x3FFF, file.little(28, 2) & 0x3FFF, 1, kBits, kArithmetic};
    if (kind != "VP8L") return std::nullopt;
    const std::uint64_t both = file.little(21, 4);
    return HeadSize{(both & 0x3FFF) + 1, (both >> 14 & 0x3FFF) + 1, 1, kBits, kArithmetic};
}

/// Lines of text, then "-Y HEIGHT +X WIDTH".
std::optional<HeadSize> hdrSize(const HeadBytes& file) {
    constexpr std::size_t kLongest = 1 << 16;
    const std::string head = file.text(0, kLongest);
    const std::size_t end = head.find("\n\n");
    if (end == std::string::npos) return head.size() < kLongest ? std::nullopt : std::optional(kUnknown);
    const auto numbers = numbersIn(std::string_view(head).substr(end, 80), 2);
    if (numbers.size() < 2) return std::nullopt;
    return HeadSize{numbers[1], numbers[0], 1, 32, kRuns * 32};  // runs of old files multiply each other
}

std::optional<HeadSize> pnmSize(const HeadBytes& file) {
    constexpr std::size_t kLongest = 1 << 16;
    const std::string head = file.text(0, kLongest);
    const char kind = head[1];
    const auto numbers = numbersIn(std::string_view(head).substr(2), kind == '1' || kind == '4' ? 2 : 3);
    if (numbers.size() < 2) return head.size() < kLongest ? std::nullopt : std::optional(kUnknown);
    const std::uint64_t bytes = numbers.size() > 2 && numbers[2] > 255 ? 2 : 1;
    const std::uint64_t colours = kind == '3' || kind == '6' ? 3 : 1;
    // In text form a number takes at least one character; black and white pixels take one bit each.
    const std::uint64_t bits = kind == '4' ? 1 : kind <= '3' ? 8 * colours : 8 * bytes * colours;
    return HeadSize{numbers[0], numbers[1], 1, bits, 1};
}

/// Texts of a PNG file may be packed, and its library keeps a thousand of them, of 8 MB each.
std::string whyPngTextsAreTooLong(const HeadBytes& file) {
    constexpr std::uint64_t kMaxOfOne = 8'000'000, kMaxOfAll = std::uint64_t{64} << 20;
    std::uint64_t at = 8, all = 0;
    while (at + 12 <= file.size()) {
        const std::uint64_t length = file.big(at, 4);
        const std::string kind = file.text(at + 4, 4);
        if (kind == "zTXt" || kind == "iTXt" || kind == "iCCP") all += std::min(length * kDeflate, kMaxOfOne);
        if (kind == "IEND" || length > file.size()) break;
        at += 12 + length;
    }
    if (all <= kMaxOfAll) return {};
    return fmt::format("the PNG file's packed texts may take {} bytes, and {} are let", all, kMaxOfAll);
}

struct TiffTags {
    std::uint64_t width = 0, height = 0, depth = 1, bits = 1, packing = 1, samples = 1, tileWidth = 0, tileHeight = 0;
    std::array<bool, 8> seen{};
};

void noteTag(const HeadBytes& file, std::uint64_t at, bool isWide, TiffTags& tags) {
    const std::uint64_t tag = file.number(at, 2), kind = file.number(at + 2, 2), value = at + (isWide ? 12 : 8);
    const std::uint64_t count = file.number(at + 4, isWide ? 8 : 4);
    const std::uint64_t bytes = kind == 3 ? 2 : kind == 16 ? 8 : kind == 1 ? 1 : 4;
    // Several numbers that do not fit stand elsewhere; for the tags that are read they are all equal.
    const bool isElsewhere = count > (isWide ? 8u : 4u) / bytes;
    const std::uint64_t number =
        file.number(isElsewhere ? file.number(value, isWide ? 8 : 4) : value, static_cast<std::size_t>(bytes));
    const std::pair<std::uint64_t, std::uint64_t*> known[] = {
        {256, &tags.width},   {257, &tags.height},    {258, &tags.bits},       {259, &tags.packing},
        {277, &tags.samples}, {322, &tags.tileWidth}, {323, &tags.tileHeight}, {32997, &tags.depth},
    };
    for (std::size_t i = 0; i < std::size(known); ++i)
        if (known[i].first == tag && !std::exchange(tags.seen[i], true)) *known[i].second = number;  // the first counts
}

std::optional<HeadSize> tiffSize(HeadBytes file) {
    file.setBigEndian(file.byte(0) == 'M');
    const bool isWide = file.number(2, 2) == 43;  // BigTIFF
    const std::uint64_t first = file.number(isWide ? 8 : 4, isWide ? 8 : 4);
    const std::uint64_t count = std::min<std::uint64_t>(file.number(first, isWide ? 8 : 2), 4096);
    TiffTags tags;
    for (std::uint64_t i = 0; i < count; ++i) noteTag(file, first + (isWide ? 8 + 20 * i : 2 + 12 * i), isWide, tags);
    std::uint64_t maximum = kArithmetic;
    if (tags.packing == 1) maximum = 1;
    if (tags.packing == 2 || tags.packing == 3 || tags.packing == 4)
        maximum = std::max<std::uint64_t>(tags.width, 8);  // a row like the one before takes a bit
    if (tags.packing == 5) maximum = kLzw;
    if (tags.packing == 8 || tags.packing == 32946) maximum = kDeflate;
    if (tags.packing == 32773) maximum = kRuns;
    // Tiles are whole, also where the picture ends within them.
    const auto whole = [](std::uint64_t size, std::uint64_t part) {
        return part == 0 ? size : (size + part - 1) / part * part;
    };
    if (tags.tileWidth > kLargestSide || tags.tileHeight > kLargestSide || tags.width > kLargestSide ||
        tags.height > kLargestSide)
        return kUnknown;
    return HeadSize{whole(tags.width, tags.tileWidth), whole(tags.height, tags.tileHeight),
                    std::max<std::uint64_t>(tags.depth, 1), tags.bits * tags.samples, maximum};
}

std::optional<HeadSize> sizeIn(const HeadBytes& file) {
    using namespace std::string_view_literals;
    const std::string start = file.text(0, 16);
    const std::string_view head = start;
    if (head.size() < 16) return std::nullopt;
    if (head.starts_with("\x89PNG"sv)) return pngSize(file);
    if (head.starts_with("\xFF\xD8\xFF"sv)) return jpegSize(file);
    if (head.starts_with("GIF8"sv)) return HeadSize{file.little(6, 2), file.little(8, 2), 1, 32, kLzw * 4};
    if (head.starts_with("BM"sv)) return bmpSize(file);
    if (head.starts_with("II*\0"sv) || head.starts_with("MM\0*"sv) || head.starts_with("II+\0"sv) ||
        head.starts_with("MM\0+"sv))
        return tiffSize(file);
    if (head.starts_with("#?RADIANCE"sv) || head.starts_with("#?RGBE"sv)) return hdrSize(file);
    if (head.starts_with("DDS "sv)) return ddsSize(file);
    if (head.starts_with("RIFF"sv) && head.substr(8, 4) == "WEBP"sv) return webpSize(file);
    if (head[0] == 'P' && head[1] >= '1' && head[1] <= '6') return pnmSize(file);
    if (file.size() > 26 && file.text(file.size() - 18, 16) == "TRUEVISION-XFILE") return tgaSize(file);
    return std::nullopt;
}

}  // namespace

std::string whyNotWithin(const ByteSource& source) {
    const HeadBytes file(source);
    if (isExr(file)) return whyNotWithinExr(file);
    if (file.text(0, 4) == "\x89PNG")
        if (std::string why = whyPngTextsAreTooLong(file); !why.empty()) return why;
    if (file.text(0, 3) == "\xFF\xD8\xFF")
        if (std::string why = whyJpegHasTooManyScans(file); !why.empty()) return why;
    const std::optional<HeadSize> size = sizeIn(file);
    return size ? whyTooLarge(*size, file.size()) : std::string();
}

std::string whyNotWithin(std::span<const std::uint8_t> file) {
    return whyNotWithin(ByteSource{file.size(), [file](std::uint64_t offset, void* to, std::size_t length) {
                                       if (offset >= file.size()) return std::size_t{0};
                                       const auto part = file.subspan(static_cast<std::size_t>(offset));
                                       length = std::min(length, part.size());
                                       std::memcpy(to, part.data(), length);
                                       return length;
                                   }});
}

}  // namespace rtsg
