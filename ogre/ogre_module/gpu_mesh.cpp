// Fills vertex and index buffers.
#include "gpu_mesh.h"

#include <cstddef>

#include <OgreHardwareBufferManager.h>

namespace rtsg {

GpuMesh::GpuMesh() {
    vertices_.vertexStart = 0, vertices_.vertexCount = 0;
    indices_.indexStart = 0, indices_.indexCount = 0;
}

void GpuMesh::declare(bool strokes) {
    if (declared_ && strokes == strokes_) return;
    using namespace Ogre;
    VertexDeclaration& declaration = *vertices_.vertexDeclaration;
    declaration.removeAllElements();
    const auto add = [&](std::size_t at, VertexElementType type, VertexElementSemantic what, unsigned short index = 0,
                         unsigned short stream = 0) { declaration.addElement(stream, at, type, what, index); };
    if (strokes) {
        add(offsetof(RasterStroke, start), VET_FLOAT3, VES_POSITION);
        add(offsetof(RasterStroke, startNormal), VET_FLOAT3, VES_NORMAL);
        add(offsetof(RasterStroke, end), VET_FLOAT3, VES_TEXTURE_COORDINATES, 0);
        add(offsetof(RasterStroke, endNormal), VET_FLOAT3, VES_TEXTURE_COORDINATES, 1);
        add(offsetof(RasterStroke, startColor), VET_FLOAT4, VES_TEXTURE_COORDINATES, 2);
        add(offsetof(RasterStroke, endColor), VET_FLOAT4, VES_TEXTURE_COORDINATES, 3);
        add(offsetof(RasterStroke, corner), VET_FLOAT4, VES_TEXTURE_COORDINATES, 4);
    } else {
        // Apart, since a mesh that deforms fills the first alone.
        add(offsetof(RasterVertex, position), VET_FLOAT3, VES_POSITION);
        add(offsetof(RasterVertex, normal), VET_FLOAT3, VES_NORMAL);
        add(offsetof(RasterLook, coordinates), VET_FLOAT3, VES_TEXTURE_COORDINATES, 0, 1);
        add(offsetof(RasterLook, color), VET_FLOAT4, VES_TEXTURE_COORDINATES, 1, 1);
    }
    strokes_ = strokes, declared_ = true;
    vertices_.vertexBufferBinding->unsetAllBindings();
    vertices_.vertexCount = 0;
}

void GpuMesh::fill(unsigned short stream, const void* data, std::size_t size, std::size_t count) {
    using namespace Ogre;
    VertexBufferBinding& binding = *vertices_.vertexBufferBinding;
    if (!binding.isBufferBound(stream) || binding.getBuffer(stream)->getNumVertices() != count)
        binding.setBinding(stream, HardwareBufferManager::getSingleton().createVertexBuffer(
                                       size, count, HardwareBuffer::HBU_DYNAMIC_WRITE_ONLY));
    binding.getBuffer(stream)->writeData(0, count * size, data, true);
}

void GpuMesh::set(const RasterMesh& mesh) {
    using namespace Ogre;
    declare(mesh.vertices.empty() && !mesh.strokes.empty());
    const std::size_t count = strokes_ ? mesh.strokes.size() : mesh.vertices.size();
    if (count == 0 || mesh.indices.empty()) {
        indices_.indexCount = 0;
        return;
    }
    vertices_.vertexCount = count;
    if (strokes_) {
        fill(0, mesh.strokes.data(), sizeof(RasterStroke), count);
    } else {
        fill(0, mesh.vertices.data(), sizeof(RasterVertex), count);
        fill(1, mesh.looks.data(), sizeof(RasterLook), count);
    }
    if (mesh.indices.size() != indices_.indexCount || !indices_.indexBuffer)
        indices_.indexBuffer = HardwareBufferManager::getSingleton().createIndexBuffer(
            HardwareIndexBuffer::IT_32BIT, mesh.indices.size(), HardwareBuffer::HBU_DYNAMIC_WRITE_ONLY);
    indices_.indexCount = mesh.indices.size();
    indices_.indexBuffer->writeData(0, mesh.indices.size_bytes(), mesh.indices.data(), true);
    lower_ = mesh.lower, upper_ = mesh.upper;
}

void GpuMesh::bend(const RasterMesh& mesh) {
    fill(0, mesh.vertices.data(), sizeof(RasterVertex), mesh.vertices.size());
    if (!mesh.looks.empty()) fill(1, mesh.looks.data(), sizeof(RasterLook), mesh.looks.size());
    lower_ = mesh.lower, upper_ = mesh.upper;
}

Ogre::RenderOperation GpuMesh::operation() const {
    Ogre::RenderOperation operation;
    operation.operationType = Ogre::RenderOperation::OT_TRIANGLE_LIST;
    operation.useIndexes = true;
    operation.vertexData = const_cast<Ogre::VertexData*>(&vertices_);
    operation.indexData = const_cast<Ogre::IndexData*>(&indices_);
    return operation;
}

}  // namespace rtsg
