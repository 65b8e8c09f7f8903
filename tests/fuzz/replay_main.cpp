// Runs a fuzz target without libFuzzer, with any compiler: on seeded noise, on every file of its corpus, and on seeded
// damage to each. The same inputs in every run.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace {

using Bytes = std::vector<std::uint8_t>;
constexpr int kDamaged = 8, kNoise = 256;

void run(const Bytes& input) {
    LLVMFuzzerTestOneInput(input.data(), input.size());
}

/// Some bits flipped, and mostly cut or with a piece doubled.
Bytes damaged(Bytes input, std::mt19937& random) {
    if (input.empty()) return input;
    for (auto flips = 1 + random() % 8; flips > 0; --flips)
        input[random() % input.size()] ^= static_cast<std::uint8_t>(1u << random() % 8);
    const auto from = static_cast<std::ptrdiff_t>(random() % input.size());
    if (random() % 3 == 0)
        input.resize(static_cast<std::size_t>(from));
    else if (random() % 2 == 0) {
        const Bytes piece(input.begin() + from, input.end());
        input.insert(input.end(), piece.begin(), piece.end());
    }
    return input;
}

}  // namespace

int main(int count, char** arguments) {
    namespace fs = std::filesystem;
    std::mt19937 random(1);
    std::size_t inputs = 0;
    for (int i = 0; i < kNoise; ++i, ++inputs) {
        Bytes noise(random() % 512);
        std::ranges::generate(noise, [&] { return static_cast<std::uint8_t>(random()); });
        run(noise);
    }
    if (count > 1) {
        std::vector<fs::path> files;
        for (const auto& entry : fs::recursive_directory_iterator(arguments[1]))
            if (entry.is_regular_file()) files.push_back(entry.path());
        std::ranges::sort(files);
        for (const fs::path& file : files) {
            std::ifstream in(file, std::ios::binary);
            const Bytes input{std::istreambuf_iterator<char>(in), {}};
            run(input);
            for (int i = 0; i < kDamaged; ++i) run(damaged(input, random));
            inputs += 1 + kDamaged;
        }
    }
    std::printf("%zu inputs\n", inputs);
    return inputs > 0 ? 0 : 1;
}
