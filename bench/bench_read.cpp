// Reading: text to arrays, against the text's own bytes.
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <rtsg/documents/filter.h>
#include <rtsg/documents/loader.h>

#include "bench.h"

namespace rtsg::bench {

namespace {

/// A wavy grid of n x n quads, two triangles each.
std::string meshText(int n) {
    std::string text =
        "#X3D V4.0 utf8\nPROFILE Interchange\nShape { geometry IndexedFaceSet { coord Coordinate { point [\n";
    text.reserve(static_cast<std::size_t>(n) * static_cast<std::size_t>(n) * 80);
    for (int z = 0; z <= n; ++z)
        for (int x = 0; x <= n; ++x)
            fmt::format_to(std::back_inserter(text), "{:.5g} {:.5g} {:.5g},\n", x * .013f,
                           std::sin(x * .1f) * std::cos(z * .07f), z * .013f);
    text += "] }\ncoordIndex [\n";
    for (int z = 0; z < n; ++z)
        for (int x = 0; x < n; ++x) {
            const int a = z * (n + 1) + x, b = a + 1, c = a + n + 1, d = c + 1;
            fmt::format_to(std::back_inserter(text), "{} {} {} -1 {} {} {} -1\n", a, c, b, b, c, d);
        }
    text += "] } }\n";
    return text;
}

/// Counts the bytes of the arrays that go by, and keeps them as a scene would.
struct ReadKeeper final : Filter {
    std::vector<Value> values;
    std::size_t bytes = 0;
    void setField(std::string_view, Value value, SourceLocation) override {
        if (value.holds<Array<Vec3f>>()) bytes += value.as<Array<Vec3f>>().size() * sizeof(Vec3f);
        if (value.holds<Array<std::int32_t>>()) bytes += value.as<Array<std::int32_t>>().size() * sizeof(std::int32_t);
        values.push_back(std::move(value));
    }
};

struct PeakMemory {
    double peakBytes = 0, arrayBytes = 0;
};

/// Reads the file in a process of its own, so that nothing else counts.
PeakMemory peakOfReading(const std::filesystem::path& file) {
    int channel[2];
    if (pipe(channel) != 0) return {};
    const pid_t child = fork();
    if (child == 0) {
        const auto peak = [] {
            rusage usage{};
            getrusage(RUSAGE_SELF, &usage);
            return static_cast<double>(usage.ru_maxrss) * 1024;
        };
        const double before = peak();
        ReadKeeper keeper;
        Diagnostics diagnostics;
        readDocumentFile(file, keeper, diagnostics);
        const PeakMemory result{peak() - before, static_cast<double>(keeper.bytes)};
        const bool sent = ::write(channel[1], &result, sizeof(result)) == sizeof(result);
        _exit(sent ? 0 : 1);
    }
    PeakMemory result;
    if (child < 0 || ::read(channel[0], &result, sizeof(result)) != sizeof(result)) result = {};
    if (child > 0) waitpid(child, nullptr, 0);
    close(channel[0]);
    close(channel[1]);
    return result;
}

/// Seconds of reading the file: as readDocumentFile does it, into memory of its own, or out of a mapping.
double fileSeconds(const std::filesystem::path& file, bool mapped) {
    const double start = cpuSeconds();
    ReadKeeper keeper;
    Diagnostics diagnostics;
    if (!mapped) {
        readDocumentFile(file, keeper, diagnostics, {.threads = 1});
        return cpuSeconds() - start;
    }
    const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC);
    const auto size = static_cast<std::size_t>(std::filesystem::file_size(file));
    void* bytes = mmap(nullptr, size, PROT_READ, MAP_PRIVATE | MAP_POPULATE, descriptor, 0);
    close(descriptor);
    if (bytes == MAP_FAILED) return 0;
    readDocument({static_cast<const char*>(bytes), size}, keeper, diagnostics, {.threads = 1});
    munmap(bytes, size);
    return cpuSeconds() - start;
}

}  // namespace

void read(const Report& report, bool quick) {
    const auto file = std::filesystem::temp_directory_path() / fmt::format("rtsg-bench-{}.x3dv", getpid());
    PeakMemory memory;
    {
        // The memory is measured first: a child inherits its parent's peak.
        {
            std::ofstream(file) << meshText(quick ? 200 : 1000);
        }
    }
    memory = peakOfReading(file);
    std::vector<double> read, mapped;
    for (int i = 0; i < 3; ++i) {
        read.push_back(fileSeconds(file, false));
        mapped.push_back(fileSeconds(file, true));
    }
    std::error_code ignored;
    std::filesystem::remove(file, ignored);
    const std::string text = meshText(quick ? 200 : 1000);
    const double megabytes = static_cast<double>(text.size()) / 1e6;
    std::vector<double> ours, naive, copy;
    for (int i = 0; i < 3; ++i) {
        double start = cpuSeconds();
        ReadKeeper keeper;
        Diagnostics diagnostics;
        readDocument(text, keeper, diagnostics, {.threads = 1});
        ours.push_back(cpuSeconds() - start);
        naive.push_back(fromCharsSeconds(text));
        start = cpuSeconds();
        std::string same(text.size(), '\0');
        std::memcpy(same.data(), text.data(), text.size());
        keep(same.data());
        copy.push_back(cpuSeconds() - start);
    }
    const std::string name = quick ? "80 k triangles" : "2 M triangles";
    report({"read", name + ", ClassicVRML", "text read", "MB/s", megabytes / median(ours),
            "std::from_chars over the numbers", megabytes / median(naive), "memcpy of the text",
            megabytes / median(copy)});
    report({"read", name + ", ClassicVRML", "file read", "MB/s", megabytes / median(read), "the file mapped",
            megabytes / median(mapped), "text in memory already", megabytes / median(ours)});
    report({"read", name + ", ClassicVRML", "peak memory", "times the arrays", memory.peakBytes / memory.arrayBytes, "",
            0, "the arrays alone", 1});
}

}  // namespace rtsg::bench
