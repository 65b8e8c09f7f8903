// A mesh in the buffers of the graphics system, shared by all things that show it.
//
// Threading: the thread of the graphics context.
#pragma once

#include <memory>

#include <OgreHardwareVertexBuffer.h>
#include <OgreRenderOperation.h>
#include <OgreVertexIndexData.h>

#include "raster/raster_module.h"

namespace rtsg {

class GpuMesh {
  public:
    GpuMesh();
    /// Puts the numbers into the buffers there are if they fit exactly, as those of a mesh that deforms do.
    void set(const RasterMesh& mesh);
    /// See RasterModule::bendMesh().
    void bend(const RasterMesh& mesh);
    Ogre::RenderOperation operation() const;
    bool empty() const { return indices_.indexCount == 0; }
    bool strokes() const { return strokes_; }
    const glm::vec3& lower() const { return lower_; }
    const glm::vec3& upper() const { return upper_; }

  private:
    void declare(bool strokes);
    void fill(unsigned short stream, const void* data, std::size_t size, std::size_t count);
    Ogre::VertexData vertices_;
    Ogre::IndexData indices_;
    bool strokes_ = false, declared_ = false;
    glm::vec3 lower_{0}, upper_{0};
};

}  // namespace rtsg
