// Something that OGRE draws: a mesh with a material and a transform.
//
// Threading: the thread of the graphics context.
#pragma once

#include <string>

#include <OgreSimpleRenderable.h>

#include "gpu_material.h"
#include "gpu_mesh.h"

namespace rtsg {

class GpuObject final : public Ogre::SimpleRenderable {
  public:
    /// `view`: of the view that is drawn now; must outlive it.
    explicit GpuObject(const ViewNumbers& view);
    /// Follows the changes of the mesh.
    void show(const GpuMesh& mesh);
    void setItem(std::uint32_t number, const RasterObject& object, int record);
    /// The linear part of its transform; the translation is its scene node's.
    void setLinear(const glm::mat3& linear, bool mirrored);
    /// Makes it fill the picture, wherever the eye is.
    void setBackground();
    const RasterObject& item() const { return item_; }
    void setRecord(int record);

    void getWorldTransforms(Ogre::Matrix4* to) const override;
    Ogre::Real getSquaredViewDepth(const Ogre::Camera* camera) const override;
    Ogre::Real getBoundingRadius() const override { return radius_; }
    void _updateCustomGpuParameter(const Ogre::GpuProgramParameters::AutoConstantEntry& entry,
                                   Ogre::GpuProgramParameters* parameters) const override;

  private:
    void findBounds();
    const ViewNumbers& view_;
    RasterObject item_;
    Ogre::Vector4 numbers_, stroke_, attenuation_, named_;
    glm::vec3 lower_{0}, upper_{0};
    bool strokes_ = false;
    float radius_ = 0;
};

}  // namespace rtsg
