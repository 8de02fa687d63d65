// The plug-in against stubs (UnrealStubs.h): a session is opened, an agent walks, and a mesh's bones are read back in the
// world; the golden traces say where they must be. Then the connection is lost, and the session ends.

#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "AnimNode_Wayfarer.h"
#include "Components/SkeletalMeshComponent.h"
#include "WayfarerAnimInstance.h"
#include "WayfarerCharacterComponent.h"
#include "WayfarerSubsystem.h"
#include "crowd.hpp"
#include "golden_json.hpp"
#include "wayfarer/wayfarer.h"

namespace {

void Require(bool bHolds, const char* What) {
  if (bHolds) return;
  std::fprintf(stderr, "not so: %s\n", What);
  std::exit(1);
}
#define REQUIRE(what) Require((what), #what)

/// Answer the oldest request.
nlohmann::json Answer(const char* Verb, const std::string& Url, int32 Code, const std::string& Content) {
  REQUIRE(!StubRequests.empty());
  const auto Request = StubRequests.front();
  StubRequests.pop_front();
  std::printf("%s %s\n", Request->Verb.Utf8().c_str(), Request->Url.Utf8().c_str());
  REQUIRE(Request->Verb.Utf8() == Verb && Request->Url.Utf8() == Url);
  REQUIRE(Request->Headers.Find(TEXT("Authorization"))->Utf8() == "Bearer wf_key");
  auto Response = std::make_shared<IHttpResponse>();
  Response->Code = Code;
  Response->Content = FString(StubUtf16(Content));
  Request->Done.Call(FHttpRequestPtr(Request), FHttpResponsePtr(Response), true);
  return nlohmann::json::parse(Request->Content.Utf8(), nullptr, false);
}

/// A message, in two parts as Unreal may give it.
void Give(IWebSocket& Socket, const golden::Bytes& Bytes) {
  const SIZE_T Half = Bytes.size() / 2;
  Socket.Came.Broadcast(Bytes.data(), Half, Bytes.size() - Half);
  Socket.Came.Broadcast(Bytes.data() + Half, Bytes.size() - Half, 0);
}

USkeletalMesh MeshOf(const golden::Case& Own) {
  USkeletalMesh Mesh;
  for (const auto& Node : Own.rig.nodes()) {
    Mesh.StubSkeleton.StubNames.Add(FName(*FString(StubUtf16(Node.name))));
    Mesh.StubSkeleton.StubParents.Add(Node.parent);
    Mesh.StubSkeleton.StubRest.Add({FQuat(Node.rotation.x, Node.rotation.y, Node.rotation.z, Node.rotation.w),
                                    FVector(Node.position.x, Node.position.y, Node.position.z),
                                    FVector(Node.scale.x, Node.scale.y, Node.scale.z)});
  }
  return Mesh;
}

/// Greatest distance of a mesh's bones from their places in a trace, centimetres.
double Off(const FPoseContext& Output, const USkeletalMeshComponent& Component, const golden::Json& Found, std::size_t Frame) {
  const FReferenceSkeleton& Skeleton = Component.StubMesh->StubSkeleton;
  std::map<std::string, FVector> Places;
  TArray<FTransform> World;
  for (int32 Bone = 0; Bone < Skeleton.GetNum(); ++Bone) {
    const int32 Parent = Skeleton.GetParentIndex(Bone);
    World.Add(Output.Pose.StubBones[Bone] * (Parent < 0 ? Component.GetComponentTransform() : World[Parent]));
    Places[Skeleton.GetBoneName(Bone).ToString().Utf8()] = World[Bone].GetTranslation();
  }
  double Most = 0;
  for (const auto& Each : Found.at("poses")[Frame].at("places").items()) {
    const FVector Place = Places.at(Found.at("map").at(Each.key()));
    const golden::Json& Wanted = Each.value();
    Most = std::max({Most, std::abs(Place.X - Wanted[0].get<double>()), std::abs(Place.Y - Wanted[1].get<double>()),
                     std::abs(Place.Z - Wanted[2].get<double>())});
  }
  return Most;
}

}  // namespace

int main() {
  const golden::Walk Walk = golden::walk("unreal");
  const auto Cases = golden::cases();
  std::size_t Number = 0;
  while (Cases[Number].basis != "unreal") ++Number;
  const golden::Json Document = golden::json("retarget.json"), Found = Document.at("cases")[Number];

  UGameInstance Instance;
  UWorld World;
  UWayfarerSubsystem Subsystem;
  World.StubInstance = &Instance;
  Instance.StubSubsystem = &Subsystem;
  std::vector<std::string> Heard;
  const auto Hear = [&](const FString& What, const FString& Detail) { Heard.push_back(What.Utf8() + ": " + Detail.Utf8()); };
  Subsystem.OnStatus.AddWeakLambda(&Heard, Hear);
  Subsystem.OnRefused.AddWeakLambda(&Heard, Hear);
  Subsystem.OnEvent.AddWeakLambda(&Heard, [&](const FString& Kind, const FString&, int32 Waypoint, const FString& Detail) {
    Heard.push_back(Kind.Utf8() + " " + std::to_string(Waypoint) + ": " + Detail.Utf8());
  });

  // an actor, its mesh turned and lowered below it, as that of a Character; and larger than its file
  AActor Actor;
  USkeletalMesh Mesh = MeshOf(Cases[Number]);
  USkeletalMeshComponent Component;
  UWayfarerCharacterComponent Character;
  Actor.StubName = TEXT("Ada");
  Actor.StubPlace = FVector(120, 40, 90);
  Actor.StubComponents = {&Component, &Character};
  Component.StubMesh = &Mesh;
  Component.StubRelative = FTransform(FQuat(0, 0, -std::sqrt(0.5), std::sqrt(0.5)), FVector(0, 0, -90));
  for (UActorComponent* Each : Actor.StubComponents) Each->StubOwner = &Actor, Each->StubWorld = &World;
  Character.OriginHeight = 90;

  StubCommandLine = TEXT("Game -WayfarerServer=https://walk.example/ -log");
  Character.BeginPlay();
  Character.GoTo(FVector(200, 300, 0), 140);
  Subsystem.Open(TEXT("http://localhost:8080"), TEXT("wf_key"), TEXT("scene-1"));
  Character.TickComponent(0, LEVELTICK_All, nullptr);
  REQUIRE(Component.StubClass == UWayfarerAnimInstance::StaticClass());
  REQUIRE(Character.Problem() == TEXT("the agent has not come yet"));
  const std::string Server = "https://walk.example";
  auto Body = Answer("POST", Server + "/v1/sessions", 201, R"({"session_id": "s-1"})");
  REQUIRE(Body == nlohmann::json({{"basis", "unreal"}, {"scene", "scene-1"}}));
  Body = Answer("POST", Server + "/v1/bodies:fit", 200, R"({"gender": "male", "betas": [0.5, -1], "scale": 1})");
  REQUIRE(Body.at("basis") == "unreal" && Body.at("floor") == 0 && Body.at("joints").size() == Found.at("map").size());
  REQUIRE(Body.at("joints")[0].at("bone") == "pelvis" && Body.at("joints")[0].at("position").at("z") > 80);
  Body = Answer("POST", Server + "/v1/sessions/s-1/agents", 201, R"({"agents": [{"agent_id": "agent-0"}]})").at("agents")[0];
  REQUIRE(Body.at("gender") == "male" && Body.at("betas") == nlohmann::json({0.5, -1}));
  REQUIRE(Body.at("name") == "Ada" && Body.at("position") == nlohmann::json({{"x", 120.0}, {"y", 40.0}, {"z", 0.0}}));
  Body = Answer("PUT", Server + "/v1/agents/agent-0/goal", 404, R"({"detail": "no agent"})");
  REQUIRE(Body.at("speed") == 140.0 && Body.at("position").at("y") == 300.0);
  REQUIRE(Heard.back() == "PUT /v1/agents/agent-0/goal: no agent");
  REQUIRE(StubSockets.size() == 1);
  REQUIRE(StubSockets[0]->Url.Utf8() == "wss://walk.example/v1/stream?encoding=smallest_three&session=s-1");

  Give(*StubSockets[0], crowd::header());
  REQUIRE(Heard.back() == "open: s-1");
  FPoseContext Output;
  Output.Pose.StubRest = Mesh.StubSkeleton.StubRest;
  UWayfarerAnimInstance Animation;
  Animation.StubOwner = &Actor;
  const std::unique_ptr<FAnimInstanceProxy> Proxy(Animation.StubProxy());
  FAnimNode_Wayfarer Node;
  // each frame of the walk is held for two seconds, so that the pose is that of the trace and the smooth root arrives
  for (std::size_t Frame = 0; Frame < Walk.frames.size(); ++Frame) {
    const golden::Walk Still{Walk.rest_offsets, {Walk.frames[Frame]}};
    Give(*StubSockets[0], crowd::batch(Still, 1, 10 * Frame));
    for (int Picture = 0; Picture < 40; ++Picture) {
      StubNow += 0.05, ++GFrameCounter;
      if (Picture % 4 == 3) Give(*StubSockets[0], crowd::batch(Still, 1, 10 * Frame + 1 + static_cast<std::size_t>(Picture) / 4));
      Subsystem.Tick(0.05f);
      Character.TickComponent(0.05f, LEVELTICK_All, nullptr);
    }
    REQUIRE(Character.Problem().IsEmpty());
    Proxy->PreUpdate(&Animation, 0);
    REQUIRE(Proxy->Evaluate(Output));
    const double ByInstance = Off(Output, Component, Found, Frame);
    Node.PreUpdate(&Animation);
    Node.Evaluate_AnyThread(Output);
    std::printf("frame %zu: %.4f cm off, actor at %.1f, %.1f, %.1f, yaw %.1f\n", Frame, ByInstance, Actor.StubPlace.X,
                Actor.StubPlace.Y, Actor.StubPlace.Z, Actor.StubTurn.Yaw);
    REQUIRE(ByInstance < 0.02 && Off(Output, Component, Found, Frame) < 0.02);
    REQUIRE(std::hypot(Actor.StubPlace.X - Walk.frames[Frame][0], Actor.StubPlace.Y - Walk.frames[Frame][1]) < 3);
    REQUIRE(std::abs(Actor.StubPlace.Z - 90) < 1);
  }
  const auto Table = Character.BoneTable();
  REQUIRE(static_cast<std::size_t>(Table.Num()) == Found.at("map").size());
  for (const auto& Row : Table) REQUIRE(Found.at("map").at(Row.Key.ToString().Utf8()) == Row.Value.ToString().Utf8());
  Output.Pose.StubContainer.StubLeftOut = Character.Pose().MeshBones[5]; // of a lower level of detail
  REQUIRE(Proxy->Evaluate(Output));

  // events, loss, resumption
  golden::Bytes Event = golden::message("event");
  Give(*StubSockets[0], Event);
  REQUIRE(Heard.back() == "goal_reached 2: goal 3 of 4 reached");
  StubSockets[0]->Gone.Broadcast(1006, TEXT("cable"), false);
  REQUIRE(Heard.back() == "lost: cable" && StubSockets[0]->bClosed);
  Subsystem.Tick(0);
  REQUIRE(StubSockets.size() == 1);
  StubNow += 0.6;
  Subsystem.Tick(0);
  REQUIRE(StubSockets.size() == 2 && StubSockets[1]->Url.Utf8().find("&resume_token=epoch.") != std::string::npos);
  StubNow += 2.6;
  Subsystem.Tick(0);
  REQUIRE(Heard.back() == "lost: nothing came for 2.5 s");
  StubNow += 1.1;
  Subsystem.Tick(0);
  REQUIRE(StubSockets.size() == 3);
  StubSockets[2]->Gone.Broadcast(4404, TEXT("no session s-1"), true);
  REQUIRE(Heard.back() == "ended: no session s-1");

  // a wrong correction is reported, and a mesh that is no humanoid
  Character.CorrectedBones.Add(FName(TEXT("left_knee")), FName(TEXT("nose")));
  Subsystem.Close();
  Subsystem.SetRings(1500, 0, 30000);
  Subsystem.Look(FVector(10, 20, 170));
  Subsystem.Open(TEXT(""), TEXT("wf_key"), TEXT(""));
  Answer("POST", Server + "/v1/sessions", 201, R"({"session_id": "s-2"})");
  const std::string Url = StubSockets[3]->Url.Utf8();
  const std::string Interest = R"(&interest={"rings":[{"radius":1500},{"radius":30000,"format":{"encoding":"root"}}],)"
                               R"("viewpoints":[{"position":{"x":10,"y":20,"z":170}}]})";
  REQUIRE(Url.substr(Url.size() - Interest.size()) == Interest);
  Subsystem.Look(FVector(500, 20, 170));
  Subsystem.Tick(0);
  REQUIRE(StubSockets[3]->Texts.empty());  // the header has not come
  Give(*StubSockets[3], crowd::header());
  Subsystem.Tick(0);
  Subsystem.Look(FVector(600, 20, 170));
  Subsystem.Tick(0);
  REQUIRE(StubSockets[3]->Texts == std::vector<std::string>{R"({"viewpoints":[{"position":{"x":500,"y":20,"z":170}}]})"});
  StubNow += 0.11;
  Subsystem.Tick(0);
  Subsystem.Tick(0);
  REQUIRE(StubSockets[3]->Texts.size() == 2);
  Give(*StubSockets[3], crowd::batch(Walk, 1, 0));
  ++GFrameCounter;
  Character.TickComponent(0, LEVELTICK_All, nullptr);
  REQUIRE(Character.Problem() == TEXT("left_knee: the rig has no node \"nose\"") && !Character.Pose().bValid);
  Give(*StubSockets[3], {0x0b});
  REQUIRE(Heard.back().find("ended: cannot read the stream: malformed message") == 0 && StubSockets[3]->bClosed);
  Character.EndPlay(EEndPlayReason::Destroyed);
  Answer("DELETE", Server + "/v1/agents/agent-0", 204, "");

  // a server that is many nodes
  Subsystem.Open(TEXT(""), TEXT("wf_key"), TEXT(""));
  Answer("POST", Server + "/v1/sessions", 421, R"({"endpoint": {"host": "n1", "http_port": 7}})");
  Answer("POST", "https://n1:7/v1/sessions", 201, R"({"session_id": "session-00ff12"})");
  REQUIRE(StubSockets[4]->Url.Utf8().find("wss://n1:7/v1/stream") == 0);
  StubSockets[4]->Gone.Broadcast(4421, TEXT("call n2:7"), true);
  Subsystem.Tick(0);
  REQUIRE(StubSockets[5]->Url.Utf8().find("wss://n2:7/v1/stream") == 0);
  Subsystem.Wander(TEXT("agent-00ff34"));
  Answer("PUT", "https://n2:7/v1/agents/agent-00ff34/wander", 503, R"({"detail": "stopping"})");
  Answer("PUT", Server + "/v1/agents/agent-00ff34/wander", 404, R"({"detail": "no agent"})");
  REQUIRE(Heard.back() == "PUT /v1/agents/agent-00ff34/wander: no agent");
  StubSockets[5]->Gone.Broadcast(1006, TEXT("cable"), false);
  StubNow += 0.6;
  Subsystem.Tick(0);
  REQUIRE(StubSockets[6]->Url.Utf8().find("wss://walk.example/v1/stream") == 0);
  Subsystem.Deinitialize();
  std::puts("the plug-in holds");
}
