// Gives pictures to workers of the sandbox, and checks what comes out.
#include "sandbox_images.h"

#include <algorithm>
#include <cstring>
#include <fstream>
#include <iterator>

#include <rtsg/core/sandbox.h>

#include "head_bytes.h"
#include "sandbox_tiles.h"

namespace rtsg {

namespace {

/// A ReadRequest without its function; the picture's name follows.
struct JobHead {
    std::uint64_t freePixels = 0;  // of 8 bits that nobody needs to ask for
    std::uint32_t asFloats = 0, bottomRowFirst = 0, layers = 0, straight = 0, data = 0;
};
struct Question {
    std::int32_t width = 0, height = 0, layers = 0, eightBits = 0;
};
/// FilePixels without its arrays; a sentence follows: the damage, or why it was not read.
struct AnswerHead {
    std::uint32_t isRead = 0, width = 0, height = 0, channels = 0, layers = 0, isEncoded = 0, hasFloats = 0;
};

// ---- in the worker ---------------------------------------------------------------------------------------------

ReadRequest requestOf(SandboxJob& job, std::string& name) {
    JobHead head;
    std::string_view text = job.head();
    takeSandboxNumbers(text, head);
    name = text;
    const std::uint64_t freePixels = head.freePixels;
    return {.asFloats = head.asFloats != 0,
            .bottomRowFirst = head.bottomRowFirst != 0,
            .layers = head.layers != 0,
            .straight = head.straight != 0,
            .data = head.data != 0,
            .check = [&job, freePixels](int width, int height, int layers, bool eightBits) {
                const std::uint64_t pixels =
                    static_cast<std::uint64_t>(std::max(width, 0)) * static_cast<std::uint64_t>(std::max(height, 0));
                if (eightBits && layers == 1 && pixels <= freePixels) return std::string();
                return job.ask(sandboxText(Question{width, height, layers, eightBits ? 1 : 0}));
            }};
}

void answer(SandboxJob& job, const FilePixels& pixels) {
    const bool hasFloats = !pixels.values.empty();
    const void* const from = hasFloats ? static_cast<const void*>(pixels.values.data()) : pixels.bytes.data();
    const std::size_t size = hasFloats ? pixels.values.size() * sizeof(float) : pixels.bytes.size();
    std::memcpy(job.room(size).data(), from, size);
    job.answer(
        sandboxText(AnswerHead{1, static_cast<std::uint32_t>(pixels.width), static_cast<std::uint32_t>(pixels.height),
                               static_cast<std::uint32_t>(pixels.channels), static_cast<std::uint32_t>(pixels.layers),
                               pixels.encoded ? 1U : 0U, hasFloats ? 1U : 0U},
                    pixels.damage));
}

Result<> preparePlain() {
    constexpr std::uint8_t kWebp[] = {'R', 'I', 'F', 'F', 0, 0, 0, 0, 'W', 'E', 'B', 'P', 0};
    (void)plainReaderHere(kWebp);  // without it WebP files are for all the others' reader
    const auto reader = plainReaderHere({});
    return reader ? Result<>() : std::unexpected(reader.error());
}
void servePlain(SandboxJob& job) {
    std::string name, refused;
    const ReadRequest request = requestOf(job, name);
    FilePixels pixels;
    const auto reader = plainReaderHere(job.bytes());
    if (reader && (*reader)(job.bytes(), request, pixels, refused)) return answer(job, pixels);
    job.answer(sandboxText(AnswerHead{}, refused));
}

void serveFiles(SandboxJob& job) {
    std::string name;
    const ReadRequest request = requestOf(job, name);
    FilePixels pixels;
    const auto files = imageFilesHere();
    const std::string error =
        files ? (*files)->readMemory(job.bytes(), name, request, pixels) : std::string(files.error().text);
    if (error.empty()) return answer(job, pixels);
    job.answer(sandboxText(AnswerHead{}, error));
}

constexpr SandboxTask kPlain{"PNG, JPEG and WebP files", preparePlain, servePlain};
constexpr SandboxTask kFiles{"image files", prepareImageFiles, serveFiles};

// ---- in the process that wants the picture -----------------------------------------------------------------------

/// Makes pixels of what a worker says, which may be anything. A sentence if it contradicts itself.
std::string take(const SandboxResult& result, std::string_view text, const AnswerHead& head, FilePixels& out) {
    constexpr const char* kBroken = "the library that reads it is broken";
    const std::uint64_t element = head.hasFloats != 0 ? sizeof(float) : 1;
    const bool isSane =
        head.width - 1 < kLargestSide && head.height - 1 < kLargestSide && head.layers - 1 < kLargestSide &&
        head.channels - 1 < 4 && std::uint64_t{head.width} * head.height * head.layers <= result.size() &&
        std::uint64_t{head.width} * head.height * head.layers * head.channels * element == result.size();
    if (!isSane) return kBroken;
    out = {};
    out.width = static_cast<int>(head.width), out.height = static_cast<int>(head.height);
    out.channels = static_cast<int>(head.channels), out.layers = static_cast<int>(head.layers);
    out.encoded = head.isEncoded != 0, out.damage = text;
    if (head.hasFloats == 0) {
        out.bytes.resize(result.size());
        return result.read(out.bytes) ? "" : kBroken;
    }
    out.values.resize(result.size() / sizeof(float));
    return result.read({reinterpret_cast<std::uint8_t*>(out.values.data()), result.size()}) ? "" : kBroken;
}

/// True, or false with a sentence: why it is refused, or what the reader said.
bool readIn(const SandboxTask& task, std::span<const std::uint8_t> bytes, const std::string& name,
            const ReadRequest& request, FilePixels& out, std::string& why) {
    constexpr int kFreeSide = 256;
    const auto check = [&](const Question& asked) {
        return request.check ? request.check(asked.width, asked.height, asked.layers, asked.eightBits != 0)
                             : std::string();
    };
    JobHead head{0, request.asFloats, request.bottomRowFirst, request.layers, request.straight, request.data};
    if (!request.asFloats && check({kFreeSide, kFreeSide, 1, 1}).empty()) head.freePixels = kFreeSide * kFreeSide;
    std::string refused;
    const auto result = runSandboxed(task, sandboxText(head, name), bytes, [&](std::string_view question) {
        Question asked;
        refused = takeSandboxNumbers(question, asked) ? check(asked) : "the library that reads it is broken";
        return refused;
    });
    if (!result) return why = result.error().text, false;
    AnswerHead answered;
    std::string_view text = result->head();
    const bool isAnswer = takeSandboxNumbers(text, answered);
    if (!isAnswer || answered.isRead == 0) {
        why = !refused.empty() ? refused : std::string(text);
        return false;
    }
    // A broken library might not have asked.
    const bool isFree = answered.hasFloats == 0 && answered.layers == 1 && result->size() <= head.freePixels;
    if (!isFree && result->size() > 0) {
        const auto number = [](std::uint32_t value) { return static_cast<std::int32_t>(value & INT32_MAX); };
        why =
            check({number(answered.width), number(answered.height), number(answered.layers), answered.hasFloats == 0});
    }
    if (why.empty()) why = take(*result, text, answered, out);
    return why.empty();
}

class SandboxedFiles final : public ImageFiles {
  public:
    std::string openTiles(ByteSource source, const std::string& name,
                          std::unique_ptr<TiledPicture>& out) const override {
        return openTilesSandboxed(std::move(source), name, out);
    }
    std::string readFile(const std::string& file, const ReadRequest& request, FilePixels& out) const override {
        std::ifstream stream(file, std::ios::binary);
        if (!stream) return std::strerror(errno);
        const std::vector<char> bytes{std::istreambuf_iterator<char>(stream), {}};
        return readMemory({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()}, file, request, out);
    }
    std::string readMemory(std::span<const std::uint8_t> bytes, const std::string& name, const ReadRequest& request,
                           FilePixels& out) const override {
        std::string why;
        if (readIn(kFiles, bytes, name, request, out, why)) return {};
        return why.empty() ? "the picture cannot be read" : why;
    }
    std::string encode(const std::string& name, const Sheet& sheet, std::vector<unsigned char>& file) const override {
        const auto here = imageFilesHere();
        return here ? (*here)->encode(name, sheet, file) : here.error().text;
    }
    std::string encodeAnimation(const std::string& name, std::span<const Sheet> sheets, double framesPerSecond,
                                std::vector<unsigned char>& file) const override {
        const auto here = imageFilesHere();
        return here ? (*here)->encodeAnimation(name, sheets, framesPerSecond, file) : here.error().text;
    }
    void workAlone() const override {}
};

}  // namespace

Result<> prepareImageFiles() {
    const auto files = imageFilesHere();
    if (!files) return std::unexpected(files.error());
    (*files)->workAlone();
    return {};
}

bool readPlainSandboxed(std::span<const std::uint8_t> bytes, const ReadRequest& request, FilePixels& out,
                        std::string& refused) {
    if (request.asFloats || !isPlainKind(bytes)) return false;
    return readIn(kPlain, bytes, {}, request, out, refused);
}

const ImageFiles& sandboxedImageFiles() {
    static const SandboxedFiles files;
    return files;
}

}  // namespace rtsg
