// STUBS. Not Unreal's headers: the part of Unreal's interface that this plug-in uses, written from its public
// documentation, so that the plug-in's code can be compiled and run without Unreal. They prove nothing about
// the engine; only its compiler does.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

using int32 = std::int32_t;
using uint8 = std::uint8_t;
using uint32 = std::uint32_t;
using uint64 = std::uint64_t;
using SIZE_T = std::size_t;
using TCHAR = char16_t;
#define TEXT(text) u##text
#define INDEX_NONE (-1)
#define UCLASS(...)
#define USTRUCT(...)
#define UPROPERTY(...)
#define UFUNCTION(...)
#define WAYFARER_API
#define GENERATED_BODY() \
 public:                 \
  using ThisClass = void;
#define IMPLEMENT_MODULE(module, name) \
  extern "C" int StubModule_##name() { return sizeof(module); }
#define RETURN_QUICK_DECLARE_CYCLE_STAT(name, group) return TStatId()
struct FDefaultModuleImpl {};
struct TStatId {};

// ---- strings

inline std::string StubUtf8(const std::u16string& Text) {
  std::string Found;
  for (const char16_t C : Text) {
    if (C < 0x80) Found += static_cast<char>(C);
    else if (C < 0x800) Found += {static_cast<char>(0xc0 | C >> 6), static_cast<char>(0x80 | (C & 0x3f))};
    else Found += {static_cast<char>(0xe0 | C >> 12), static_cast<char>(0x80 | (C >> 6 & 0x3f)), static_cast<char>(0x80 | (C & 0x3f))};
  }
  return Found;
}

inline std::u16string StubUtf16(const std::string& Text) {
  std::u16string Found;
  for (std::size_t K = 0; K < Text.size();) {
    const auto B = static_cast<unsigned char>(Text[K]);
    const auto Low = [&](std::size_t N) { return static_cast<unsigned char>(Text[K + N]) & 0x3f; };
    if (B < 0x80) Found += static_cast<char16_t>(B), K += 1;
    else if (B < 0xe0) Found += static_cast<char16_t>((B & 0x1f) << 6 | Low(1)), K += 2;
    else Found += static_cast<char16_t>((B & 0xf) << 12 | Low(1) << 6 | Low(2)), K += 3;
  }
  return Found;
}

class FString {
 public:
  FString() = default;
  FString(const TCHAR* Text) : Own(Text) {}
  explicit FString(std::u16string Text) : Own(std::move(Text)) {}
  bool IsEmpty() const { return Own.empty(); }
  void Reset() { Own.clear(); }
  bool EndsWith(const TCHAR* End) const {
    const std::u16string Text(End);
    return Own.size() >= Text.size() && Own.compare(Own.size() - Text.size(), Text.size(), Text) == 0;
  }
  void LeftChopInline(int32 Count) { Own.resize(Own.size() - static_cast<std::size_t>(Count)); }
  FString RightChop(int32 Count) const { return FString(Own.substr(static_cast<std::size_t>(Count))); }
  static FString FromInt(int32 Number) { return FString(StubUtf16(std::to_string(Number))); }
  static FString Printf(const TCHAR*, int32 Number) { return FString(StubUtf16("HTTP " + std::to_string(Number))); }
  const TCHAR* operator*() const { return Own.c_str(); }
  FString& operator+=(const FString& Other) { Own += Other.Own; return *this; }
  friend FString operator+(const FString& A, const FString& B) { return FString(A.Own + B.Own); }
  friend bool operator==(const FString& A, const FString& B) { return A.Own == B.Own; }
  friend bool operator!=(const FString& A, const FString& B) { return A.Own != B.Own; }
  friend bool operator<(const FString& A, const FString& B) { return A.Own < B.Own; }
  std::string Utf8() const { return StubUtf8(Own); }

 private:
  std::u16string Own;
};

struct StubTchar {
  std::u16string Text;
  operator const TCHAR*() const { return Text.c_str(); }
};
struct StubAnsi {
  std::string Text;
  operator const char*() const { return Text.c_str(); }
};
#define UTF8_TO_TCHAR(text) static_cast<const TCHAR*>(StubTchar{StubUtf16(text)})
#define TCHAR_TO_UTF8(text) static_cast<const char*>(StubAnsi{StubUtf8(text)})

class FName {
 public:
  FName() = default;
  explicit FName(const TCHAR* Text) : Own(Text) {}
  FString ToString() const { return IsNone() ? FString(TEXT("None")) : Own; }
  bool IsNone() const { return Own.IsEmpty(); }
  friend bool operator<(const FName& A, const FName& B) { return A.Own < B.Own; }

 private:
  FString Own;
};
using FText = FString;
#define NSLOCTEXT(space, key, text) FText(TEXT(text))

// ---- containers, pointers, functions

template <class T>
class TArray {
 public:
  TArray() = default;
  TArray(std::initializer_list<T> List) : Own(List) {}
  int32 Num() const { return static_cast<int32>(Own.size()); }
  void Add(const T& Value) { Own.push_back(Value); }
  void Append(const T* Data, int32 Count) { Own.insert(Own.end(), Data, Data + Count); }
  bool Contains(const T& Value) const { return std::find(Own.begin(), Own.end(), Value) != Own.end(); }
  void Reset() { Own.clear(); }
  void SetNum(int32 Count) { Own.resize(static_cast<std::size_t>(Count)); }
  const T* GetData() const { return Own.data(); }
  T& operator[](int32 K) { return Own.at(static_cast<std::size_t>(K)); }
  const T& operator[](int32 K) const { return Own.at(static_cast<std::size_t>(K)); }
  auto begin() const { return Own.begin(); }
  auto end() const { return Own.end(); }

 private:
  std::vector<T> Own;
};

template <class K, class V>
struct TPair {
  TPair() = default;
  TPair(const K& InKey, const V& InValue) : Key(InKey), Value(InValue) {}
  K Key{};
  V Value{};
};

template <class K, class V>
class TMap {
 public:
  void Add(const K& Key, const V& Value) {
    Remove(Key);
    Own.push_back({Key, Value});
  }
  const V* Find(const K& Key) const {
    for (const auto& Each : Own)
      if (Each.Key == Key) return &Each.Value;
    return nullptr;
  }
  const K* FindKey(const V& Value) const {
    for (const auto& Each : Own)
      if (Each.Value == Value) return &Each.Key;
    return nullptr;
  }
  void Remove(const K& Key) {
    for (auto It = Own.begin(); It != Own.end(); ++It)
      if (It->Key == Key) { Own.erase(It); return; }
  }
  void Reset() { Own.clear(); }
  int32 Num() const { return static_cast<int32>(Own.size()); }
  auto begin() const { return Own.begin(); }
  auto end() const { return Own.end(); }

 private:
  std::vector<TPair<K, V>> Own;
};
inline bool operator==(const FName& A, const FName& B) { return !(A < B) && !(B < A); }

enum class ESPMode { NotThreadSafe, ThreadSafe };
template <class T, ESPMode Mode = ESPMode::ThreadSafe>
class TSharedRef;
template <class T, ESPMode Mode = ESPMode::ThreadSafe>
class TSharedPtr {
 public:
  TSharedPtr() = default;
  TSharedPtr(std::nullptr_t) {}
  TSharedPtr(std::shared_ptr<T> Pointer) : Own(std::move(Pointer)) {}
  template <class U>
  TSharedPtr(const TSharedPtr<U, Mode>& Other) : Own(Other.Own) {}
  template <class U>
  TSharedPtr(const TSharedRef<U, Mode>& Other) : Own(Other.Own) {}
  T* operator->() const { return Own.get(); }
  T& operator*() const { return *Own; }
  explicit operator bool() const { return Own != nullptr; }
  T* Get() const { return Own.get(); }
  void Reset() { Own.reset(); }
  TSharedRef<T, Mode> ToSharedRef() const { return TSharedRef<T, Mode>(Own); }
  std::shared_ptr<T> Own;
};
template <class T, ESPMode Mode>
class TSharedRef {
 public:
  explicit TSharedRef(std::shared_ptr<T> Pointer) : Own(std::move(Pointer)) {}
  T* operator->() const { return Own.get(); }
  T& operator*() const { return *Own; }
  T& Get() const { return *Own; }
  std::shared_ptr<T> Own;
};
template <class T, class D>
TSharedRef<T> MakeShareable(T* Object, D Deleter) { return TSharedRef<T>(std::shared_ptr<T>(Object, Deleter)); }
template <class T, class... Rest>
TSharedRef<T> MakeShared(Rest&&... Values) { return TSharedRef<T>(std::make_shared<T>(std::forward<Rest>(Values)...)); }
template <class T>
std::remove_reference_t<T>&& MoveTemp(T&& Value) { return static_cast<std::remove_reference_t<T>&&>(Value); }
template <class F>
using TFunction = std::function<F>;
template <class T>
struct TOptional : std::optional<T> {
  using std::optional<T>::optional;
  using std::optional<T>::operator=;
  void Reset() { this->reset(); }
};
template <class T>
struct TObjectPtr {
  TObjectPtr& operator=(T* Pointer) { Own = Pointer; return *this; }
  T* operator->() const { return Own; }
  explicit operator bool() const { return Own != nullptr; }
  bool operator!() const { return !Own; }
  T* Own = nullptr;
};
template <class T>
struct TWeakObjectPtr {
  TWeakObjectPtr(T* Pointer) : Own(Pointer), Alive(Pointer->StubAlive) {}
  bool IsValid() const { return !Alive.expired(); }
  T* operator->() const { return Own; }
  T* Own;
  std::weak_ptr<int> Alive;
};

template <class... Values>
struct StubMulticast {
  using Call = std::function<void(Values...)>;
  std::vector<std::pair<const void*, Call>> Calls;
  void Broadcast(Values... Given) const {
    const auto Now = Calls;
    for (const auto& [Who, Each] : Now) Each(Given...);
  }
  template <class T, class F>
  void AddWeakLambda(T* Who, F Each) { Calls.push_back({Who, Each}); }
  template <class T>
  void AddUObject(T* Who, void (T::*Each)(Values...)) {
    Calls.push_back({Who, [Who, Each](Values... Given) { (Who->*Each)(Given...); }});
  }
  void RemoveAll(const void* Who) {
    for (auto It = Calls.begin(); It != Calls.end();) It = It->first == Who ? Calls.erase(It) : It + 1;
  }
};
#define DECLARE_DYNAMIC_MULTICAST_DELEGATE_TwoParams(name, A, a, B, b) struct name : StubMulticast<A, B> {}
#define DECLARE_DYNAMIC_MULTICAST_DELEGATE_FourParams(name, A, a, B, b, C, c, D, d) struct name : StubMulticast<A, B, C, D> {}

// ---- mathematics. FQuat is Hamilton's, A * B turns by B first; FTransform A * B applies A first, then B

struct FVector {
  double X = 0, Y = 0, Z = 0;
  FVector() = default;
  FVector(double InX, double InY, double InZ) : X(InX), Y(InY), Z(InZ) {}
  static const FVector ZeroVector;
  friend FVector operator+(const FVector& A, const FVector& B) { return {A.X + B.X, A.Y + B.Y, A.Z + B.Z}; }
  friend FVector operator-(const FVector& A, const FVector& B) { return {A.X - B.X, A.Y - B.Y, A.Z - B.Z}; }
  friend FVector operator*(const FVector& A, const FVector& B) { return {A.X * B.X, A.Y * B.Y, A.Z * B.Z}; }
  friend FVector operator/(const FVector& A, const FVector& B) { return {A.X / B.X, A.Y / B.Y, A.Z / B.Z}; }
};
inline const FVector FVector::ZeroVector{};
struct FRotator {
  double Pitch = 0, Yaw = 0, Roll = 0;
  FRotator() = default;
  FRotator(double InPitch, double InYaw, double InRoll) : Pitch(InPitch), Yaw(InYaw), Roll(InRoll) {}
  static double NormalizeAxis(double Angle) { return std::remainder(Angle, 360.0); }
};
struct FQuat {
  double X = 0, Y = 0, Z = 0, W = 1;
  FQuat() = default;
  FQuat(double InX, double InY, double InZ, double InW) : X(InX), Y(InY), Z(InZ), W(InW) {}
  FQuat Inverse() const { return {-X, -Y, -Z, W}; }
  FVector RotateVector(const FVector& V) const {
    const auto Cross = [](const FVector& A, const FVector& B) {
      return FVector(A.Y * B.Z - A.Z * B.Y, A.Z * B.X - A.X * B.Z, A.X * B.Y - A.Y * B.X);
    };
    const FVector Q(X, Y, Z), T = FVector(2, 2, 2) * Cross(Q, V);
    return V + FVector(W, W, W) * T + Cross(Q, T);
  }
  friend FQuat operator*(const FQuat& A, const FQuat& B) {
    return {A.W * B.X + A.X * B.W + A.Y * B.Z - A.Z * B.Y, A.W * B.Y - A.X * B.Z + A.Y * B.W + A.Z * B.X,
            A.W * B.Z + A.X * B.Y - A.Y * B.X + A.Z * B.W, A.W * B.W - A.X * B.X - A.Y * B.Y - A.Z * B.Z};
  }
};
class FTransform {
 public:
  FTransform() = default;
  FTransform(const FQuat& InTurn, const FVector& InPlace, const FVector& InScale = FVector(1, 1, 1))
      : Turn(InTurn), Place(InPlace), Scale(InScale) {}
  static const FTransform Identity;
  FQuat GetRotation() const { return Turn; }
  FVector GetTranslation() const { return Place; }
  FVector GetScale3D() const { return Scale; }
  void SetRotation(const FQuat& Value) { Turn = Value; }
  void SetTranslation(const FVector& Value) { Place = Value; }
  FVector TransformPosition(const FVector& V) const { return Turn.RotateVector(Scale * V) + Place; }
  FVector InverseTransformPosition(const FVector& V) const { return Turn.Inverse().RotateVector(V - Place) / Scale; }
  friend FTransform operator*(const FTransform& A, const FTransform& B) {
    return {B.Turn * A.Turn, B.TransformPosition(A.Place), A.Scale * B.Scale};
  }

 private:
  FQuat Turn;
  FVector Place, Scale{1, 1, 1};
};
inline const FTransform FTransform::Identity{};
struct FMath {
  static double DegreesToRadians(double Value) { return Value * 3.141592653589793 / 180; }
  static double RadiansToDegrees(double Value) { return Value * 180 / 3.141592653589793; }
  static double Min(double A, double B) { return A < B ? A : B; }
};

// ---- time, command line, JSON

inline uint64 GFrameCounter = 1;
inline double StubNow = 100;
struct FPlatformTime {
  static double Seconds() { return StubNow; }
};
inline FString StubCommandLine;
struct FCommandLine {
  static const TCHAR* Get() { return *StubCommandLine; }
};
struct FParse {
  static bool Value(const TCHAR* Stream, const TCHAR* Match, FString& Into) {
    const std::u16string All(Stream), Key(Match);
    const std::size_t At = All.find(Key);
    if (At == std::u16string::npos) return false;
    const std::u16string Rest = All.substr(At + Key.size());
    Into = FString(Rest.substr(0, Rest.find(u' ')));
    return true;
  }
};
struct FGenericPlatformHttp {
  static FString UrlEncode(const FString& Text) { return Text; }
};
class FJsonObject;
class FJsonValue {
 public:
  virtual ~FJsonValue() = default;
  TSharedPtr<FJsonObject> AsObject() const;
  nlohmann::json Own;
};
class FJsonObject {
 public:
  void SetNumberField(const FString& Key, double Value) { Own[Key.Utf8()] = Value; }
  void SetStringField(const FString& Key, const FString& Value) { Own[Key.Utf8()] = Value.Utf8(); }
  void SetObjectField(const FString& Key, const TSharedPtr<FJsonObject>& Value) { Own[Key.Utf8()] = Value->Own; }
  void SetArrayField(const FString& Key, const TArray<TSharedPtr<FJsonValue>>& Values) {
    for (const auto& Each : Values) Own[Key.Utf8()].push_back(Each->Own);
  }
  FString GetStringField(const FString& Key) const { return FString(StubUtf16(Own.at(Key.Utf8()))); }
  bool TryGetStringField(const FString& Key, FString& Into) const {
    if (!Own.contains(Key.Utf8())) return false;
    Into = GetStringField(Key);
    return true;
  }
  bool TryGetNumberField(const FString& Key, int32& Into) const {
    if (!Own.contains(Key.Utf8())) return false;
    Into = Own.at(Key.Utf8());
    return true;
  }
  bool TryGetObjectField(const FString& Key, const TSharedPtr<FJsonObject>*& Into) const {
    if (!Own.contains(Key.Utf8())) return false;
    StubInner = std::make_shared<FJsonObject>();
    StubInner->Own = Own.at(Key.Utf8());
    Into = &StubInner;
    return true;
  }
  TArray<TSharedPtr<FJsonValue>> GetArrayField(const FString& Key) const {
    TArray<TSharedPtr<FJsonValue>> Found;
    for (const auto& Each : Own.at(Key.Utf8())) {
      auto Value = std::make_shared<FJsonValue>();
      Value->Own = Each;
      Found.Add(TSharedPtr<FJsonValue>(Value));
    }
    return Found;
  }
  nlohmann::json Own = nlohmann::json::object();
  mutable TSharedPtr<FJsonObject> StubInner;
};
inline TSharedPtr<FJsonObject> FJsonValue::AsObject() const {
  auto Found = std::make_shared<FJsonObject>();
  Found->Own = Own;
  return TSharedPtr<FJsonObject>(Found);
}
class FJsonValueObject : public FJsonValue {
 public:
  explicit FJsonValueObject(const TSharedPtr<FJsonObject>& Object) { Own = Object->Own; }
};
struct StubReader { FString Text; };
struct StubWriter { FString* Text; };
template <class = void>
struct TJsonReaderFactory {
  static StubReader Create(const FString& Text) { return {Text}; }
};
template <class = void>
struct TJsonWriterFactory {
  static StubWriter Create(FString* Text) { return {Text}; }
};
struct FJsonSerializer {
  static bool Serialize(const TSharedRef<FJsonObject>& Object, StubWriter Writer) {
    *Writer.Text = FString(StubUtf16(Object->Own.dump()));
    return true;
  }
  static bool Deserialize(const StubReader& Reader, TSharedPtr<FJsonObject>& Into) {
    const auto Read = nlohmann::json::parse(Reader.Text.Utf8(), nullptr, false);
    if (!Read.is_object()) return false;
    Into = TSharedPtr<FJsonObject>(std::make_shared<FJsonObject>());
    Into->Own = Read;
    return true;
  }
};

// ---- HTTP and WebSockets: requests wait until the test answers

class IHttpResponse {
 public:
  int32 GetResponseCode() const { return Code; }
  FString GetContentAsString() const { return Content; }
  int32 Code = 0;
  FString Content;
};
class IHttpRequest;
using FHttpRequestPtr = TSharedPtr<IHttpRequest, ESPMode::ThreadSafe>;
using FHttpResponsePtr = TSharedPtr<IHttpResponse, ESPMode::ThreadSafe>;
struct FHttpRequestCompleteDelegate {
  std::function<void(FHttpRequestPtr, FHttpResponsePtr, bool)> Call;
  template <class T, class F>
  void BindWeakLambda(T*, F Each) { Call = Each; }
};
inline std::deque<std::shared_ptr<IHttpRequest>> StubRequests;
class IHttpRequest : public std::enable_shared_from_this<IHttpRequest> {
 public:
  void SetURL(const FString& Value) { Url = Value; }
  void SetVerb(const FString& Value) { Verb = Value; }
  void SetTimeout(float) {}
  void SetHeader(const FString& Key, const FString& Value) { Headers.Add(Key, Value); }
  void SetContentAsString(const FString& Value) { Content = Value; }
  FHttpRequestCompleteDelegate& OnProcessRequestComplete() { return Done; }
  bool ProcessRequest() { StubRequests.push_back(shared_from_this()); return true; }
  FString Url, Verb, Content;
  TMap<FString, FString> Headers;
  FHttpRequestCompleteDelegate Done;
};
class FHttpModule {
 public:
  static FHttpModule& Get() { static FHttpModule Only; return Only; }
  TSharedRef<IHttpRequest, ESPMode::ThreadSafe> CreateRequest() { return MakeShared<IHttpRequest>(); }
};
class IWebSocket {
 public:
  void Connect() {}
  void Close(int32 = 1000, const FString& = FString()) { bClosed = true; }
  void Send(const FString& Text) { Texts.push_back(Text.Utf8()); }
  std::vector<std::string> Texts;
  StubMulticast<const FString&>& OnConnectionError() { return Failed; }
  StubMulticast<int32, const FString&, bool>& OnClosed() { return Gone; }
  StubMulticast<const void*, SIZE_T, SIZE_T>& OnRawMessage() { return Came; }
  FString Url;
  TMap<FString, FString> Headers;
  bool bClosed = false;
  StubMulticast<const FString&> Failed;
  StubMulticast<int32, const FString&, bool> Gone;
  StubMulticast<const void*, SIZE_T, SIZE_T> Came;
};
inline std::vector<std::shared_ptr<IWebSocket>> StubSockets;
class FWebSocketsModule {
 public:
  static FWebSocketsModule& Get() { static FWebSocketsModule Only; return Only; }
  TSharedRef<IWebSocket> CreateWebSocket(const FString& Url, const TArray<FString>&, const TMap<FString, FString>& Headers) {
    auto Made = std::make_shared<IWebSocket>();
    Made->Url = Url;
    Made->Headers = Headers;
    StubSockets.push_back(Made);
    return TSharedRef<IWebSocket>(Made);
  }
};

// ---- objects

class UClass {};
class UObject {
 public:
  virtual ~UObject() = default;
  FString GetName() const { return StubName; }
  FString StubName;
  std::shared_ptr<int> StubAlive = std::make_shared<int>(0);
};
class UGameInstanceSubsystem : public UObject {
 public:
  using Super = UGameInstanceSubsystem;
  virtual void Deinitialize() {}
};
class FTickableGameObject {
 public:
  virtual ~FTickableGameObject() = default;
  virtual void Tick(float) = 0;
  virtual bool IsTickable() const = 0;
  virtual TStatId GetStatId() const = 0;
};
class UGameInstance : public UObject {
 public:
  template <class T>
  T* GetSubsystem() const { return static_cast<T*>(StubSubsystem); }
  UGameInstanceSubsystem* StubSubsystem = nullptr;
};
class UWorld : public UObject {
 public:
  UGameInstance* GetGameInstance() const { return StubInstance; }
  UGameInstance* StubInstance = nullptr;
};
class AActor;
enum ELevelTick { LEVELTICK_All };
enum ETickingGroup { TG_PrePhysics };
struct FActorComponentTickFunction {
  bool bCanEverTick = false;
  ETickingGroup TickGroup = TG_PrePhysics;
};
namespace EEndPlayReason { enum Type { Destroyed }; }
class UActorComponent : public UObject {
 public:
  using Super = UActorComponent;
  virtual void BeginPlay() {}
  virtual void EndPlay(const EEndPlayReason::Type) {}
  virtual void TickComponent(float, ELevelTick, FActorComponentTickFunction*) {}
  AActor* GetOwner() const { return StubOwner; }
  UWorld* GetWorld() const { return StubWorld; }
  void SetComponentTickEnabled(bool) {}
  void AddTickPrerequisiteComponent(UActorComponent*) {}
  FActorComponentTickFunction PrimaryComponentTick;
  AActor* StubOwner = nullptr;
  UWorld* StubWorld = nullptr;
};
class AActor : public UObject {
 public:
  template <class T>
  T* FindComponentByClass() const {
    for (UActorComponent* Each : StubComponents)
      if (T* Found = dynamic_cast<T*>(Each)) return Found;
    return nullptr;
  }
  FVector GetActorLocation() const { return StubPlace; }
  FRotator GetActorRotation() const { return StubTurn; }
  bool SetActorLocationAndRotation(const FVector& Place, const FRotator& Turn) {
    StubPlace = Place, StubTurn = Turn;
    return true;
  }
  std::vector<UActorComponent*> StubComponents;
  FVector StubPlace;
  FRotator StubTurn;
};

// ---- skeletons and animation

class FReferenceSkeleton {
 public:
  int32 GetNum() const { return StubNames.Num(); }
  FName GetBoneName(int32 K) const { return StubNames[K]; }
  int32 GetParentIndex(int32 K) const { return StubParents[K]; }
  const TArray<FTransform>& GetRefBonePose() const { return StubRest; }
  TArray<FName> StubNames;
  TArray<int32> StubParents;
  TArray<FTransform> StubRest;
};
struct FVector3f {
  float X, Y, Z;
};
class FPositionVertexBuffer {
 public:
  const void* GetVertexData() const { return StubPlaces.empty() ? nullptr : StubPlaces.data(); }
  uint32 GetNumVertices() const { return static_cast<uint32>(StubPlaces.size()); }
  const FVector3f& VertexPosition(uint32 K) const { return StubPlaces[K]; }
  std::vector<FVector3f> StubPlaces;
};
class FSkinWeightVertexBuffer {
 public:
  uint32 GetNumVertices() const { return static_cast<uint32>(StubBones.size()); }
  uint32 GetMaxBoneInfluences() const { return 4; }
  uint32 GetBoneIndex(uint32 Vertex, uint32 K) const { return K == 1 ? StubBones[Vertex] : 0; }
  std::uint16_t GetBoneWeight(uint32, uint32 K) const { return K == 1 ? 65535 : 0; }
  std::vector<uint32> StubBones;
};
struct FSkelMeshRenderSection {
  uint32 BaseVertexIndex = 0, NumVertices = 0;
  TArray<std::uint16_t> BoneMap;
};
struct FStaticMeshVertexBuffers {
  FPositionVertexBuffer PositionVertexBuffer;
};
class FSkeletalMeshLODRenderData {
 public:
  const FSkinWeightVertexBuffer* GetSkinWeightVertexBuffer() const { return &StubWeights; }
  FStaticMeshVertexBuffers StaticVertexBuffers;
  TArray<FSkelMeshRenderSection> RenderSections;
  FSkinWeightVertexBuffer StubWeights;
};
class FSkeletalMeshRenderData {
 public:
  TArray<FSkeletalMeshLODRenderData> LODRenderData;
};
class USkeletalMesh : public UObject {
 public:
  FSkeletalMeshRenderData* GetResourceForRendering() const { return StubRender.get(); }
  std::shared_ptr<FSkeletalMeshRenderData> StubRender;
  const FReferenceSkeleton& GetRefSkeleton() const { return StubSkeleton; }
  FReferenceSkeleton StubSkeleton;
};
class UAnimInstance;
class USkeletalMeshComponent : public UActorComponent {
 public:
  USkeletalMesh* GetSkeletalMeshAsset() const { return StubMesh; }
  UAnimInstance* GetAnimInstance() const { return StubInstance; }
  void SetAnimInstanceClass(UClass* Class) { StubClass = Class; }
  FVector GetComponentScale() const { return GetComponentTransform().GetScale3D(); }
  FTransform GetComponentTransform() const { // of a component below its actor, turned as a Character's mesh is
    const double Half = FMath::DegreesToRadians(StubOwner->GetActorRotation().Yaw) / 2;
    return StubRelative * FTransform(FQuat(0, 0, std::sin(Half), std::cos(Half)), StubOwner->GetActorLocation());
  }
  USkeletalMesh* StubMesh = nullptr;
  UAnimInstance* StubInstance = nullptr;
  UClass* StubClass = nullptr;
  FTransform StubRelative;
};
struct FMeshPoseBoneIndex {
  explicit FMeshPoseBoneIndex(int32 K) : Index(K) {}
  int32 Index;
};
struct FCompactPoseBoneIndex {
  int32 GetInt() const { return Index; }
  int32 Index;
};
class FBoneContainer {
 public:
  FCompactPoseBoneIndex MakeCompactPoseIndex(const FMeshPoseBoneIndex& Bone) const { return {Bone.Index == StubLeftOut ? INDEX_NONE : Bone.Index}; }
  int32 StubLeftOut = INDEX_NONE;
};
struct FCompactPose {
  const FBoneContainer& GetBoneContainer() const { return StubContainer; }
  FTransform& operator[](const FCompactPoseBoneIndex& Bone) { return StubBones[Bone.Index]; }
  FBoneContainer StubContainer;
  TArray<FTransform> StubBones, StubRest;
};
struct FPoseContext {
  void ResetToRefPose() { Pose.StubBones = Pose.StubRest; }
  FCompactPose Pose;
};
struct FAnimationInitializeContext {};
struct FAnimationCacheBonesContext {};
struct FAnimationUpdateContext {};
struct FPoseLink {
  void Initialize(const FAnimationInitializeContext&) {}
  void CacheBones(const FAnimationCacheBonesContext&) {}
  void Update(const FAnimationUpdateContext&) {}
  void Evaluate(FPoseContext& Output) { Output.ResetToRefPose(); }
};
struct FAnimNode_Base {
  virtual ~FAnimNode_Base() = default;
  virtual void Initialize_AnyThread(const FAnimationInitializeContext&) {}
  virtual void CacheBones_AnyThread(const FAnimationCacheBonesContext&) {}
  virtual void Update_AnyThread(const FAnimationUpdateContext&) {}
  virtual void Evaluate_AnyThread(FPoseContext&) {}
  virtual bool HasPreUpdate() const { return false; }
  virtual void PreUpdate(const UAnimInstance*) {}
};
struct FAnimInstanceProxy {
  FAnimInstanceProxy() = default;
  explicit FAnimInstanceProxy(UAnimInstance*) {}
  virtual ~FAnimInstanceProxy() = default;
  virtual void PreUpdate(UAnimInstance*, float) {}
  virtual bool Evaluate(FPoseContext&) { return false; }
};
class UAnimInstance : public UObject {
 public:
  static UClass* StaticClass() { static UClass Only; return &Only; }
  AActor* GetOwningActor() const { return StubOwner; }
  FAnimInstanceProxy* StubProxy() { return CreateAnimInstanceProxy(); }
  AActor* StubOwner = nullptr;

 protected:
  virtual FAnimInstanceProxy* CreateAnimInstanceProxy() { return new FAnimInstanceProxy(this); }
};
namespace ENodeTitleType { enum Type { FullTitle }; }
class UAnimGraphNode_Base : public UObject {
 public:
  virtual FText GetNodeTitle(ENodeTitleType::Type) const { return FText(); }
  virtual FText GetTooltipText() const { return FText(); }
};
