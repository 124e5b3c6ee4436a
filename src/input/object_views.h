// What several message types share when an object of theirs is looked at instead of its bytes.
#pragma once

#include <string>
#include <type_traits>

#include <std_msgs/Header.h>

#include "input/mesh_views.h"

namespace dccd {

inline HeaderView viewOfHeader(const std_msgs::Header& header) {
  if (header.stamp.nsec >= 1000000000u) {
    throw WireError("header.stamp has " + std::to_string(header.stamp.nsec) + " nanoseconds");
  }
  return {static_cast<StampNs>(header.stamp.toNSec()), header.frame_id};
}

/// A vector of plain elements as a span of their bytes.
template <typename Element, typename Vector>
WireSpan<Element> spanOf(const Vector& elements) {
  static_assert(sizeof(Element) == sizeof(typename Vector::value_type), "the element is laid out as on the wire");
  static_assert(std::is_standard_layout_v<typename Vector::value_type>);
  return {reinterpret_cast<const std::uint8_t*>(elements.data()), elements.size()};
}

/// A cloud of points, alone or in a message of another type.
template <typename Cloud>
CloudView viewOfCloud(const Cloud& cloud, const std::string& extra_field) {
  CloudView view;
  view.header = viewOfHeader(cloud.header);
  view.height = cloud.height;
  view.width = cloud.width;
  CloudFieldFinder finder(extra_field);
  for (const auto& field : cloud.fields) finder.add(field.name, field.offset, field.datatype, view);
  finder.finish(view);
  view.big_endian = cloud.is_bigendian != 0;
  view.point_step = cloud.point_step;
  view.row_step = cloud.row_step;
  view.data = cloud.data.data();
  checkStrides(view, cloud.data.size());
  return view;
}

}  // namespace dccd
