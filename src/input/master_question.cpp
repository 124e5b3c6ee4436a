#include "input/master_question.h"

#include <ros/master.h>
#include <ros/this_node.h>
#include <xmlrpcpp/XmlRpcClient.h>
#include <xmlrpcpp/XmlRpcException.h>

namespace dccd {

bool askMaster(const char* method, const std::string& argument, double timeout_s, XmlRpc::XmlRpcValue& answer) {
  XmlRpc::XmlRpcValue request, response;
  request[0] = ros::this_node::getName();
  if (!argument.empty()) request[1] = argument;
  XmlRpc::XmlRpcClient client(ros::master::getHost().c_str(), static_cast<int>(ros::master::getPort()), "/");
  if (!client.executeNonBlock(method, request)) return false;
  client._disp.work(timeout_s * 1e3);
  const bool done = client.executeCheckDone(response) && !client.isFault();
  client.close();
  // A status code, a sentence for people, the value.
  if (!done || response.getType() != XmlRpc::XmlRpcValue::TypeArray || response.size() != 3) return false;
  if (response[0].getType() != XmlRpc::XmlRpcValue::TypeInt || static_cast<int>(response[0]) != 1) return false;
  answer = response[2];
  return true;
}

std::optional<std::map<std::string, std::string>> publishedTopics(double timeout_s) {
  XmlRpc::XmlRpcValue topics;
  std::map<std::string, std::string> types;
  try {
    // An argument of one slash stands for all names.
    if (!askMaster("getPublishedTopics", "/", timeout_s, topics)) return {};
    for (int i = 0; i < topics.size(); ++i) types[topics[i][0]] = static_cast<std::string>(topics[i][1]);
  } catch (const XmlRpc::XmlRpcException&) {  // an answer of another shape
    return {};
  }
  return types;
}

std::optional<std::vector<std::string>> registeredPublishers(const std::string& topic, double timeout_s) {
  XmlRpc::XmlRpcValue state;
  std::vector<std::string> nodes;
  try {
    if (!askMaster("getSystemState", "", timeout_s, state)) return {};
    XmlRpc::XmlRpcValue& published = state[0];  // before subscribers and services
    for (int i = 0; i < published.size(); ++i) {
      if (static_cast<std::string>(published[i][0]) != topic) continue;
      for (int n = 0; n < published[i][1].size(); ++n) nodes.push_back(published[i][1][n]);
    }
  } catch (const XmlRpc::XmlRpcException&) {
    return {};
  }
  return nodes;
}

}  // namespace dccd
