// What is done to the lanes of a packet, eight at a time, and the choice between that and sixteen.
#include "packet_kernels.h"

#include "mesh/simd8.h"
#include "packet_kernels_impl.h"

namespace rtsg::trace {

namespace {

struct Lanes8 {
    using F = simd::F8;
    using I = simd::I8;
    using F4 = float __attribute__((vector_size(16)));
    static constexpr int kLanes = 8;

    static F load(const float* p) { return simd::load(p); }
    static void store(float* p, F v) { simd::store(p, v); }
    static void store(std::int32_t* p, I v) { std::memcpy(p, &v, sizeof v); }
    static F root(F v) { return simd::sqrt(v); }
    static std::uint32_t bits(I mask) { return simd::laneBits(mask); }
    static I lanesOf(std::uint32_t mask) {
        const I each{1, 2, 4, 8, 16, 32, 64, 128};
        return (each & static_cast<std::int32_t>(mask)) != 0;
    }
    static F columns() { return F{0, 1, 2, 3, 0, 1, 2, 3}; }
    static F rows(int at) { return at == 0 ? F{0, 0, 0, 0, 1, 1, 1, 1} : F{2, 2, 2, 2, 3, 3, 3, 3}; }

    /// What `use` leaves out becomes `other`.
    static void copy(std::uint32_t* to, const std::uint32_t* from, I use, std::uint32_t other) {
        I lanes;
        std::memcpy(&lanes, from, sizeof lanes);
        lanes = use ? lanes : I{} + static_cast<std::int32_t>(other);
        std::memcpy(to, &lanes, sizeof lanes);
    }
    /// Four floats each from two places.
    static F quads(const float* const* places) {
        F4 low, high;
        std::memcpy(&low, places[0], sizeof low), std::memcpy(&high, places[1], sizeof high);
        return __builtin_shufflevector(low, high, 0, 1, 2, 3, 4, 5, 6, 7);
    }
    template <int j>
    static F spread(F v) {
        return __builtin_shufflevector(v, v, j, j, j, j, 4 + j, 4 + j, 4 + j, 4 + j);
    }
    /// Of four by four in each half.
    static void transpose(F& a, F& b, F& c, F& d) {
        const F ab = __builtin_shufflevector(a, b, 0, 8, 1, 9, 4, 12, 5, 13);
        const F abHigh = __builtin_shufflevector(a, b, 2, 10, 3, 11, 6, 14, 7, 15);
        const F cd = __builtin_shufflevector(c, d, 0, 8, 1, 9, 4, 12, 5, 13);
        const F cdHigh = __builtin_shufflevector(c, d, 2, 10, 3, 11, 6, 14, 7, 15);
        a = __builtin_shufflevector(ab, cd, 0, 1, 8, 9, 4, 5, 12, 13);
        b = __builtin_shufflevector(ab, cd, 2, 3, 10, 11, 6, 7, 14, 15);
        c = __builtin_shufflevector(abHigh, cdHigh, 0, 1, 8, 9, 4, 5, 12, 13);
        d = __builtin_shufflevector(abHigh, cdHigh, 2, 3, 10, 11, 6, 7, 14, 15);
    }
    /// Half q of each goes to row q.
    static void addRows(F a, F b, F c, F d, float* to, std::size_t stride) {
        const auto add = [](float* p, F v) { store(p, load(p) + v); };
        add(to, __builtin_shufflevector(a, b, 0, 1, 2, 3, 8, 9, 10, 11));
        add(to + 8, __builtin_shufflevector(c, d, 0, 1, 2, 3, 8, 9, 10, 11));
        add(to + stride, __builtin_shufflevector(a, b, 4, 5, 6, 7, 12, 13, 14, 15));
        add(to + stride + 8, __builtin_shufflevector(c, d, 4, 5, 6, 7, 12, 13, 14, 15));
    }
};

}  // namespace

const PacketKernels& packetKernels8() {
    static constexpr const PacketKernels& table = KernelsOf<Lanes8>::kTable;
    return table;
}

const PacketKernels& packetKernels() {
    static const PacketKernels& chosen = packetKernels16() ? *packetKernels16() : packetKernels8();
    return chosen;
}

}  // namespace rtsg::trace
