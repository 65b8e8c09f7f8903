// Places things, and sets the parameters of their programs.
#include "gpu_object.h"

#include <cmath>

#include <OgreCamera.h>
#include <OgreRenderQueue.h>
#include <OgreSceneNode.h>

namespace rtsg {

GpuObject::GpuObject(const ViewNumbers& view) : view_(view) {
    setCastShadows(false);
    setUseIdentityView(false);
}

void GpuObject::show(const GpuMesh& mesh) {
    setRenderOperation(mesh.operation());
    lower_ = mesh.lower(), upper_ = mesh.upper(), strokes_ = mesh.strokes();
    setVisible(!mesh.empty());
    findBounds();
}

void GpuObject::setItem(std::uint32_t number, const RasterObject& object, int record) {
    item_ = object;
    named_ = {static_cast<float>(number) + 1, 0, 0, 0};
    stroke_ = {object.stroke.x, object.stroke.y, object.stroke.z, object.stroke.w};
    attenuation_ = {object.attenuation.x, object.attenuation.y, object.attenuation.z, object.attenuation.w};
    setVisibilityFlags(1u << std::min<unsigned>(object.layer, 31));
    setRecord(record);
    setLinear(object.linear, object.mirrored);
}

void GpuObject::setRecord(int record) {
    const int kind = (item_.colored ? 1 : 0) + (item_.alphaColored ? 2 : 0) + (item_.fogged ? 4 : 0);
    const int sides = (item_.fronts ? 1 : 0) + (item_.backs ? 2 : 0);
    numbers_ = {static_cast<float>(record), static_cast<float>(kind), static_cast<float>(sides), numbers_.w};
}

void GpuObject::setLinear(const glm::mat3& linear, bool mirrored) {
    item_.linear = linear, item_.mirrored = mirrored;
    numbers_.w = mirrored ? -1.0f : 1.0f;
    findBounds();
}

void GpuObject::setBackground() {
    setBoundingBox(Ogre::AxisAlignedBox::BOX_INFINITE);
    setRenderQueueGroup(Ogre::RENDER_QUEUE_BACKGROUND);
}

void GpuObject::findBounds() {
    const glm::vec3 middle = item_.linear * (.5f * (lower_ + upper_)), half = .5f * (upper_ - lower_);
    const glm::mat3& m = item_.linear;
    const glm::vec3 reach = glm::abs(m[0]) * half.x + glm::abs(m[1]) * half.y + glm::abs(m[2]) * half.z;
    radius_ = glm::length(glm::abs(middle) + reach);
    if (strokes_ || !std::isfinite(radius_))  // wider than their bounds
        setBoundingBox(Ogre::AxisAlignedBox::BOX_INFINITE);
    else
        setBoundingBox({middle.x - reach.x, middle.y - reach.y, middle.z - reach.z, middle.x + reach.x,
                        middle.y + reach.y, middle.z + reach.z});
    if (mParentNode) mParentNode->needUpdate();
}

void GpuObject::getWorldTransforms(Ogre::Matrix4* to) const {
    const glm::mat3& m = item_.linear;
    const Ogre::Vector3 at = mParentNode ? mParentNode->_getDerivedPosition() : Ogre::Vector3::ZERO;
    *to = Ogre::Matrix4(m[0].x, m[1].x, m[2].x, at.x, m[0].y, m[1].y, m[2].y, at.y, m[0].z, m[1].z, m[2].z, at.z, 0, 0,
                        0, 1);
}

Ogre::Real GpuObject::getSquaredViewDepth(const Ogre::Camera* camera) const {
    const glm::vec3 middle = item_.linear * (.5f * (lower_ + upper_));
    const Ogre::Vector3 at = mParentNode->_getDerivedPosition() + Ogre::Vector3(middle.x, middle.y, middle.z);
    const float squared = (at - camera->getDerivedPosition()).squaredLength();
    return item_.first ? squared * 1.00001f : squared;
}

void GpuObject::_updateCustomGpuParameter(const Ogre::GpuProgramParameters::AutoConstantEntry& entry,
                                          Ogre::GpuProgramParameters* parameters) const {
    const auto which = static_cast<DrawNumber>(entry.data);
    const Ogre::Vector4& value = which == DrawNumber::item          ? numbers_
                                 : which == DrawNumber::stroke      ? stroke_
                                 : which == DrawNumber::attenuation ? attenuation_
                                 : which == DrawNumber::named       ? named_
                                                                    : view_[entry.data];
    parameters->_writeRawConstant(entry.physicalIndex, value, entry.elementCount);
}

}  // namespace rtsg
