// Packets of 16 rays in one register: the tree's traversal and the way into an object's frame, for AVX-512 machines.
//
// Invariant: bit for bit what TreeView::traverse and trace.cpp do with two registers of eight. It is faster for
// two reasons: half the instructions, and Embree's AVX-512 kernels read what was stored 64 bytes at a time without
// waiting. The unit is compiled for x86-64-v4, and called only where the machine has it: it must not use inline
// functions that others use, too, or the linker might give everyone its version. Threading: none of its own.
#pragma once

#include <rtsg/core/machine.h>

#include "tree_view.h"

namespace rtsg::bvh::avx512 {

/// Called for an object with all-ones for the lanes that meet its box.
using Leaf = void (*)(void* self, std::uint32_t object, const std::int32_t* lanes);

/// Does what TreeView::traverse does for packets. Precondition: isSupported() and at least one node.
void traverse(const TreeView::Node* const* pages, std::size_t count, const RayPacket16& rays,
              const std::int32_t* active, Leaf leaf, void* self);

/// Origins and directions as they were.
struct alignas(64) SavedRays {
    float values[6][16];
};
/// Puts the packet's rays into a frame: `m` by columns, after subtracting the translation.
void enter(RayPacket16& rays, const float* m, const float* translation, SavedRays& saved);
void leave(RayPacket16& rays, const SavedRays& saved);
/// The ranges of numbers in rays that queries accept.
struct Limits {
    float coordinate;         // at most
    float shortest, longest;  // direction
};
/// Sets `valid` for the active lanes whose ray is within the limits, and returns a bit for each of the others.
std::uint32_t findValid(const RayPacket16& rays, const Limits& limits, std::int32_t* valid);
/// The members of a packet that its maker leaves to us.
void complete(RayPacket16& rays, std::uint32_t mask);
/// The same as the function of that name in rays_together.h.
bool runTogether(const RayPacket16& rays, const std::int32_t* valid, float parallel, float nearby);
/// A bit for each lane that has hit something.
std::uint32_t findHits(const RayPacket16& rays);
/// Copies the packet's hits: places on triangles, triangles, and normals as they are.
void copyHits(const RayPacket16& rays, PacketHits16& hits);
/// The same directions with length 1; a direction of length 0 becomes +z.
void makeUnit(PacketHits16& hits);

/// Whether this build has it: false for other processors' and for compilers that cannot.
bool isBuilt();
/// Whether this machine has it, too.
inline bool isSupported() {
    return isBuilt() && simd::hasAvx512();
}

}  // namespace rtsg::bvh::avx512
