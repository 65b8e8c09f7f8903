// Walks the boxes of an MP4 file and adds up the samples that they count.
#include "film_tables.h"

#include <algorithm>
#include <array>

namespace rtsg {

namespace {

constexpr int kDeepest = 12;        // boxes within boxes
constexpr int kMaxBoxes = 1 << 18;  // hours of a film in pieces have some ten thousand

class SampleCounts {
  public:
    explicit SampleCounts(const MovieBytes& bytes) : bytes_(bytes) {}

    std::string whyTooMany() {
        const std::string first = name(4);
        if (first != "ftyp" && first != "moov" && first != "mdat") return {};
        add(0, bytes_.size, 0);
        if (isPacked_) return "a film whose head is packed (cmov) is not read";
        if (boxes_ > kMaxBoxes) return "the film has more than " + std::to_string(kMaxBoxes) + " boxes";
        if (samples_ <= bytes_.size) return {};
        return "the film's tables count " + std::to_string(samples_) + " samples, which are not in a file of " +
               std::to_string(bytes_.size) + " bytes";
    }

  private:
    std::uint64_t number(std::uint64_t at, std::size_t count) const {
        std::array<std::uint8_t, 8> read{};
        if (at < bytes_.size) bytes_.read(at, std::span(read).first(count));
        std::uint64_t result = 0;
        for (std::size_t i = 0; i < count; ++i) result = result << 8 | read[i];
        return result;
    }
    std::string name(std::uint64_t at) const {
        std::array<std::uint8_t, 4> read{};
        if (at < bytes_.size) bytes_.read(at, read);
        return {read.begin(), read.end()};
    }
    static bool holdsBoxes(const std::string& kind) {
        constexpr std::array kKinds{"moov", "trak", "mdia", "minf", "stbl", "mvex", "moof", "traf", "udta",
                                    "edts", "dinf", "tref", "wave", "sinf", "schi", "ipro", "mfra"};
        return std::ranges::find(kKinds, kind) != kKinds.end();
    }
    void add(std::uint64_t at, std::uint64_t end, int depth) {
        constexpr std::uint64_t kHead = 8, kLongHead = 16;
        while (at + kHead <= end && ++boxes_ <= kMaxBoxes) {
            std::uint64_t size = number(at, 4), head = kHead;
            const std::string kind = name(at + 4);
            if (size == 1) size = number(at + 8, 8), head = kLongHead;
            if (size == 0) size = end - at;  // to the end of the enclosing box
            size = std::min(size, end - at);
            if (size < head) return;
            const std::uint64_t content = at + head;
            isPacked_ = isPacked_ || kind == "cmov";
            if (kind == "stsz" || kind == "stz2") samples_ += number(content + 8, 4);
            if (kind == "trun") samples_ += number(content + 4, 4);
            if (holdsBoxes(kind) && depth < kDeepest) add(content, at + size, depth + 1);
            if (kind == "meta" && depth < kDeepest) add(content + 4, at + size, depth + 1);  // behind a version
            at += size;
        }
    }

    const MovieBytes& bytes_;
    std::uint64_t samples_ = 0;
    int boxes_ = 0;
    bool isPacked_ = false;
};

}  // namespace

std::string whyTablesAreTooLong(const MovieBytes& bytes) {
    return SampleCounts(bytes).whyTooMany();
}

}  // namespace rtsg
