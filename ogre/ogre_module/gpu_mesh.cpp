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
    const auto add = [&](std::size_t at, VertexElementType type, VertexElementSemantic what, unsigned short index = 0) {
        declaration.addElement(0, at, type, what, index);
    };
    if (strokes) {
        add(offsetof(RasterStroke, start), VET_FLOAT3, VES_POSITION);
        add(offsetof(RasterStroke, startNormal), VET_FLOAT3, VES_NORMAL);
        add(offsetof(RasterStroke, end), VET_FLOAT3, VES_TEXTURE_COORDINATES, 0);
        add(offsetof(RasterStroke, endNormal), VET_FLOAT3, VES_TEXTURE_COORDINATES, 1);
        add(offsetof(RasterStroke, startColor), VET_FLOAT4, VES_TEXTURE_COORDINATES, 2);
        add(offsetof(RasterStroke, endColor), VET_FLOAT4, VES_TEXTURE_COORDINATES, 3);
        add(offsetof(RasterStroke, corner), VET_FLOAT4, VES_TEXTURE_COORDINATES, 4);
    } else {
        add(offsetof(RasterVertex, position), VET_FLOAT3, VES_POSITION);
        add(offsetof(RasterVertex, normal), VET_FLOAT3, VES_NORMAL);
        add(offsetof(RasterVertex, coordinates), VET_FLOAT3, VES_TEXTURE_COORDINATES, 0);
        add(offsetof(RasterVertex, color), VET_FLOAT4, VES_TEXTURE_COORDINATES, 1);
    }
    strokes_ = strokes, declared_ = true;
    vertices_.vertexBufferBinding->unsetAllBindings();
    vertices_.vertexCount = 0;
}

void GpuMesh::set(const RasterMesh& mesh) {
    using namespace Ogre;
    declare(mesh.vertices.empty() && !mesh.strokes.empty());
    HardwareBufferManager& buffers = HardwareBufferManager::getSingleton();
    const std::size_t count = strokes_ ? mesh.strokes.size() : mesh.vertices.size();
    const std::size_t size = strokes_ ? sizeof(RasterStroke) : sizeof(RasterVertex);
    const void* data = strokes_ ? static_cast<const void*>(mesh.strokes.data()) : mesh.vertices.data();
    if (count == 0 || mesh.indices.empty()) {
        indices_.indexCount = 0;
        return;
    }
    if (count != vertices_.vertexCount) {
        vertices_.vertexBufferBinding->setBinding(
            0, buffers.createVertexBuffer(size, count, HardwareBuffer::HBU_DYNAMIC_WRITE_ONLY));
        vertices_.vertexCount = count;
    }
    vertices_.vertexBufferBinding->getBuffer(0)->writeData(0, count * size, data, true);
    if (mesh.indices.size() != indices_.indexCount || !indices_.indexBuffer)
        indices_.indexBuffer = buffers.createIndexBuffer(HardwareIndexBuffer::IT_32BIT, mesh.indices.size(),
                                                         HardwareBuffer::HBU_DYNAMIC_WRITE_ONLY);
    indices_.indexCount = mesh.indices.size();
    indices_.indexBuffer->writeData(0, mesh.indices.size_bytes(), mesh.indices.data(), true);
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
