// A client of OpenIGTLink made with the protocol's own library, for python/tests/test_igtlink_peer.py:
//   igtlink_peer HOST PORT
// Asks for the capabilities, sends the model `Plate`, whose top is the plane A = 5 mm, and a transform that
// moves it by 10 mm to A. Then it prints each message that arrives, after the library has checked its CRC,
// until the end of the connection:
//   TRANSFORM NAME 12 numbers, row by row     STRING NAME TEXT     CAPABILITY NAME TYPES
#include <igtlCapabilityMessage.h>
#include <igtlClientSocket.h>
#include <igtlMessageHeader.h>
#include <igtlPolyDataMessage.h>
#include <igtlStringMessage.h>
#include <igtlTransformMessage.h>

#include <cstdlib>
#include <iostream>
#include <string>
#include <vector>

namespace {

/// A box of 80 x 10 x 80 mm: its top and its bottom are quadrilaterals, its four sides one triangle strip.
igtl::PolyDataMessage::Pointer plate() {
  constexpr float kHalf = 40;
  constexpr float kHeight = 5;
  auto points = igtl::PolyDataPointArray::New();
  for (const float a : {-kHeight, kHeight}) {
    points->AddPoint(-kHalf, a, -kHalf);
    points->AddPoint(kHalf, a, -kHalf);
    points->AddPoint(kHalf, a, kHalf);
    points->AddPoint(-kHalf, a, kHalf);
  }
  auto polygons = igtl::PolyDataCellArray::New();
  igtlUint32 bottom[] = {0, 1, 2, 3};
  igtlUint32 top[] = {7, 6, 5, 4};
  polygons->AddCell(4, bottom);
  polygons->AddCell(4, top);
  auto strips = igtl::PolyDataCellArray::New();
  igtlUint32 sides[] = {0, 4, 1, 5, 2, 6, 3, 7, 0, 4};
  strips->AddCell(10, sides);
  auto normals = igtl::PolyDataAttribute::New();  // what the bridge leaves out
  normals->SetType(igtl::PolyDataAttribute::POINT_NORMAL);
  normals->SetName("normals");
  normals->SetSize(8);
  std::vector<igtlFloat32> numbers(24, 1.0F);
  normals->SetData(numbers.data());

  auto message = igtl::PolyDataMessage::New();
  message->SetDeviceName("Plate");
  message->SetPoints(points);
  message->SetPolygons(polygons);
  message->SetTriangleStrips(strips);
  message->AddAttribute(normals);
  return message;
}

igtl::TransformMessage::Pointer place() {
  igtl::Matrix4x4 matrix = {{1, 0, 0, 0}, {0, 1, 0, 10}, {0, 0, 1, 0}, {0, 0, 0, 1}};
  auto message = igtl::TransformMessage::New();
  message->SetDeviceName("Plate");
  message->SetMatrix(matrix);
  return message;
}

template <class Message>
bool send(igtl::ClientSocket& socket, const Message& message) {
  message->Pack();
  return socket.Send(message->GetPackPointer(), message->GetPackSize()) != 0;
}

/// The body of a message whose header has arrived; null at the end of the connection and for a wrong CRC.
template <class Message>
typename Message::Pointer receive(igtl::ClientSocket& socket, igtl::MessageHeader::Pointer& header) {
  auto message = Message::New();
  message->SetMessageHeader(header);
  message->AllocatePack();
  const int size = message->GetPackBodySize();
  if (socket.Receive(message->GetPackBodyPointer(), size) != size) return nullptr;
  if ((message->Unpack(1) & igtl::MessageHeader::UNPACK_BODY) != 0) return message;
  std::cerr << header->GetDeviceType() << " " << header->GetDeviceName() << ": the library refuses it\n";
  return nullptr;
}

bool print(igtl::ClientSocket& socket, igtl::MessageHeader::Pointer& header) {
  const std::string type = header->GetDeviceType();
  std::cout << type << " " << header->GetDeviceName();
  if (type == "TRANSFORM") {
    const auto message = receive<igtl::TransformMessage>(socket, header);
    if (!message) return false;
    igtl::Matrix4x4 matrix;
    message->GetMatrix(matrix);
    for (int row = 0; row < 3; ++row)
      for (int column = 0; column < 4; ++column) std::cout << " " << matrix[row][column];
  } else if (type == "STRING") {
    const auto message = receive<igtl::StringMessage>(socket, header);
    if (!message) return false;
    std::cout << " " << message->GetString();
  } else if (type == "CAPABILITY") {
    const auto message = receive<igtl::CapabilityMessage>(socket, header);
    if (!message) return false;
    for (const std::string& name : message->GetTypes()) std::cout << " " << name.c_str();
  } else {
    return false;
  }
  std::cout << "\n" << std::flush;
  return true;
}

}  // namespace

int main(int count, char** arguments) {
  if (count != 3) {
    std::cerr << "igtlink_peer HOST PORT\n";
    return 2;
  }
  auto socket = igtl::ClientSocket::New();
  if (socket->ConnectToServer(arguments[1], std::atoi(arguments[2])) != 0) return 1;
  auto question = igtl::GetCapabilityMessage::New();
  question->SetDeviceName("peer");
  if (!send(*socket, question) || !send(*socket, plate()) || !send(*socket, place())) return 1;
  while (true) {
    auto header = igtl::MessageHeader::New();
    header->InitPack();
    if (socket->Receive(header->GetPackPointer(), header->GetPackSize()) != header->GetPackSize()) return 0;
    header->Unpack();
    if (!print(*socket, header)) return 1;
  }
}
