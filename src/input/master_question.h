// Questions to the master that come back: roscpp's own calls wait for a master that hangs as long as it does.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include <xmlrpcpp/XmlRpcValue.h>

namespace dccd {

/// Datatypes of all topics that somebody publishes, by resolved name; "*" where the master knows none. Of publishers
/// with different types on one topic the one that registered last. Nothing: the master did not answer in time.
std::optional<std::map<std::string, std::string>> publishedTopics(double timeout_s);

/// The nodes that are registered as publishers of the topic, those that were killed included. Nothing: as above.
std::optional<std::vector<std::string>> registeredPublishers(const std::string& topic, double timeout_s);

/// The master's answer to one of its methods, called with this node's name and `argument`. False: none in time, or one
/// that reports a failure.
bool askMaster(const char* method, const std::string& argument, double timeout_s, XmlRpc::XmlRpcValue& answer);

}  // namespace dccd
