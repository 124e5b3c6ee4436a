#!/usr/bin/env python3
"""Tells the monitor what MoveIt's planning scene attaches and lets go of (doc/robot.md).

It needs moveit_msgs, which Debian does not have.
"""
import rospy
from deformable_ccd.srv import AttachObject, AttachObjectRequest, Named
from geometry_msgs.msg import Point, Pose, Quaternion
from moveit_msgs.msg import AttachedCollisionObject, CollisionObject

MONITOR = '/collision_monitor/'
parts = {}  # of each object, the names that the monitor knows


def turned(q, x, y, z):
    """The vector, turned by the quaternion."""
    tx, ty, tz = 2 * (q.y * z - q.z * y), 2 * (q.z * x - q.x * z), 2 * (q.x * y - q.y * x)
    return (x + q.w * tx + q.y * tz - q.z * ty, y + q.w * ty + q.z * tx - q.x * tz, z + q.w * tz + q.x * ty - q.y * tx)


def joined(a, b):
    """The pose b, which is given in the frame of a. A pose that nobody set is none."""
    p, q = a.orientation, b.orientation
    p, q = [one if one.x or one.y or one.z or one.w else Quaternion(w=1) for one in (p, q)]
    x, y, z = turned(p, b.position.x, b.position.y, b.position.z)
    return Pose(Point(a.position.x + x, a.position.y + y, a.position.z + z),
                Quaternion(p.w * q.x + p.x * q.w + p.y * q.z - p.z * q.y, p.w * q.y - p.x * q.z + p.y * q.w + p.z * q.x,
                           p.w * q.z + p.x * q.y - p.y * q.x + p.z * q.w, p.w * q.w - p.x * q.x - p.y * q.y - p.z * q.z))


def take(message):
    object_ = message.object
    call = lambda service, kind, *request: rospy.ServiceProxy(MONITOR + service, kind)(*request)
    if object_.operation == CollisionObject.REMOVE:
        for name in parts.get(object_.id, []):
            rospy.loginfo(call('detach', Named, name).message)
        return
    if object_.header.frame_id not in ('', message.link_name):
        return rospy.logerr('%s: its pose must be in the frame of %s', object_.id, message.link_name)
    for name in parts.pop(object_.id, []):  # what was let go before, or is attached anew
        call('remove', Named, name)
    shapes = [(s, p, None) for s, p in zip(object_.primitives, object_.primitive_poses)]
    shapes += [(None, p, s) for s, p in zip(object_.meshes, object_.mesh_poses)]
    for number, (primitive, pose, mesh) in enumerate(shapes, 1):
        request = AttachObjectRequest(name=object_.id + ('' if number == 1 else '/%d' % number), link=message.link_name,
                                      touches=[link for link in message.touch_links if link != message.link_name])
        request.pose = joined(getattr(object_, 'pose', Pose()), pose)  # Melodic has no such field
        if primitive:
            request.primitive = primitive
        else:
            request.triangles = mesh
        request.scale.x = request.scale.y = request.scale.z = 1
        answer = call('attach', AttachObject, request)
        rospy.loginfo(answer.message) if answer.success else rospy.logerr(answer.message)
        parts.setdefault(object_.id, []).append(request.name)


rospy.init_node('attached_to_monitor')
rospy.Subscriber('/attached_collision_object', AttachedCollisionObject, take, queue_size=100)
rospy.spin()
