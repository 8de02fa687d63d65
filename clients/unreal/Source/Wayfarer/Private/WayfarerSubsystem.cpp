#include "WayfarerSubsystem.h"

#include "Dom/JsonObject.h"
#include "Dom/JsonValue.h"
#include "GenericPlatform/GenericPlatformHttp.h"
#include "HttpModule.h"
#include "IWebSocket.h"
#include "Interfaces/IHttpRequest.h"
#include "Interfaces/IHttpResponse.h"
#include "Misc/CommandLine.h"
#include "Misc/Parse.h"
#include "Modules/ModuleManager.h"
#include "Serialization/JsonReader.h"
#include "Serialization/JsonSerializer.h"
#include "Serialization/JsonWriter.h"
#include "WebSocketsModule.h"
#include "wayfarer/wayfarer.h"

IMPLEMENT_MODULE(FDefaultModuleImpl, Wayfarer)

namespace
{
constexpr double RetryFirst = 0.5, RetryMost = 8; // seconds; doubled at each failure
constexpr double Silence = 2.5; // seconds without a heartbeat (one per second) that mean a dead connection
// close codes: 4000 + the HTTP status of the error
constexpr int32 Ended = 1000, UnknownCaller = 4401, Forbidden = 4403, NotFound = 4404, Invalid = 4422;

TSharedPtr<FJsonObject> Place(const FVector& Location)
{
	TSharedPtr<FJsonObject> Found = MakeShared<FJsonObject>();
	Found->SetNumberField(TEXT("x"), Location.X);
	Found->SetNumberField(TEXT("y"), Location.Y);
	Found->SetNumberField(TEXT("z"), Location.Z);
	return Found;
}

TSharedRef<wf_route> RouteOf(wf_homes* Homes, const FString& About)
{
	return MakeShareable(wf_route_create(Homes, TCHAR_TO_UTF8(*About)), [](wf_route* Route) { wf_route_destroy(Route); });
}

/** Whether a refused call continues at another node of a cluster. */
bool GoesOn(wf_route* Route, int32 Status, const TSharedPtr<FJsonObject>& Answer)
{
	const TSharedPtr<FJsonObject>* Place = nullptr;
	FString Host;
	int32 Port = 0;
	if (Answer && Answer->TryGetObjectField(TEXT("endpoint"), Place))
	{
		(*Place)->TryGetStringField(TEXT("host"), Host);
		(*Place)->TryGetNumberField(TEXT("http_port"), Port);
	}
	return wf_route_refused(Route, Status, TCHAR_TO_UTF8(*Host), Port) != 0;
}

/** The id of the session or scene that an answer has created, or "". */
FString Made(const FJsonObject& Answer)
{
	FString Id;
	if (!Answer.TryGetStringField(TEXT("session_id"), Id)) Answer.TryGetStringField(TEXT("scene_id"), Id);
	return Id;
}

FString AgentPath(const FString& Id, const TCHAR* Rest)
{
	return TEXT("/v1/agents/") + FGenericPlatformHttp::UrlEncode(Id) + Rest;
}
}

void UWayfarerSubsystem::Open(FString Server, FString Token, const FString& Scene)
{
	TArray<TFunction<void()>> Waiting;
	if (!Core) Waiting = MoveTemp(WhenOpen); // of actors that began to play before this
	Close();
	WhenOpen = MoveTemp(Waiting);
	FParse::Value(FCommandLine::Get(), TEXT("WayfarerServer="), Server);
	FParse::Value(FCommandLine::Get(), TEXT("WayfarerToken="), Token);
	while (Server.EndsWith(TEXT("/"))) Server.LeftChopInline(1);
	Address = Server;
	Key = Token;
	Homes = wf_homes_create(TCHAR_TO_UTF8(*Address));
	Core = wf_player_create();
	if (!Core)
	{
		OnStatus.Broadcast(TEXT("ended"), UTF8_TO_TCHAR(wf_error()));
		return;
	}
	wf_player_on_added(Core, [](void* User, uint32_t Alias) {
		UWayfarerSubsystem* Self = static_cast<UWayfarerSubsystem*>(User);
		const FString Id = UTF8_TO_TCHAR(wf_agent_id(Self->Core, Alias));
		Self->Aliases.Add(Id, Alias);
		Self->OnAgentAdded.Broadcast(Id, UTF8_TO_TCHAR(wf_agent_name(Self->Core, Alias)));
	}, this);
	wf_player_on_removed(Core, [](void* User, uint32_t Alias) {
		UWayfarerSubsystem* Self = static_cast<UWayfarerSubsystem*>(User);
		const FString* Id = Self->Aliases.FindKey(Alias);
		if (!Id) return;
		const FString Gone = *Id;
		Self->Aliases.Remove(Gone);
		Self->OnAgentRemoved.Broadcast(Gone, TEXT(""));
	}, this);
	wf_player_on_event(Core, [](void* User, const char* Kind, const char* AgentId, double, uint32_t, uint32_t Waypoint, const char* Detail) {
		static_cast<UWayfarerSubsystem*>(User)->OnEvent.Broadcast(
			UTF8_TO_TCHAR(Kind), UTF8_TO_TCHAR(AgentId), static_cast<int32>(Waypoint), UTF8_TO_TCHAR(Detail));
	}, this);
	OnStatus.Broadcast(TEXT("opening"), Address);
	TSharedPtr<FJsonObject> Wanted = MakeShared<FJsonObject>();
	Wanted->SetStringField(TEXT("basis"), TEXT("unreal"));
	if (!Scene.IsEmpty()) Wanted->SetStringField(TEXT("scene"), Scene);
	Call(TEXT("POST"), TEXT("/v1/sessions"), Wanted, [this](const FJsonObject& Answer) {
		SessionId = Answer.GetStringField(TEXT("session_id"));
		StreamRoute = RouteOf(Homes, SessionId);
		Connect();
		TArray<TFunction<void()>> Ready = MoveTemp(WhenOpen);
		WhenOpen.Reset();
		for (const TFunction<void()>& Each : Ready) Each();
	});
}

void UWayfarerSubsystem::Close()
{
	DropSocket();
	if (!SessionId.IsEmpty()) Call(TEXT("DELETE"), TEXT("/v1/sessions/") + FGenericPlatformHttp::UrlEncode(SessionId), nullptr, nullptr);
	++Opened;
	SessionId.Reset();
	Forgotten.Reset();
	WhenOpen.Reset();
	if (Core) wf_player_clear(Core);
	wf_player_destroy(Core);
	Core = nullptr;
	wf_homes_destroy(Homes);
	Homes = nullptr;
	StreamRoute.Reset();
	bMoved = false;
	Aliases.Reset();
	Retry = RetryFirst;
	ConnectAt = 0;
	AdvancedIn = 0;
}

void UWayfarerSubsystem::Deinitialize()
{
	Close();
	Super::Deinitialize();
}

TStatId UWayfarerSubsystem::GetStatId() const
{
	RETURN_QUICK_DECLARE_CYCLE_STAT(UWayfarerSubsystem, STATGROUP_Tickables);
}

void UWayfarerSubsystem::CreateAgent(const FString& Name, const FVector& Location, double Yaw, const TSharedPtr<FJsonObject>& Character, TFunction<void(const FString&)> Created)
{
	if (SessionId.IsEmpty())
	{
		WhenOpen.Add([this, Name, Location, Yaw, Character, Created] { CreateAgent(Name, Location, Yaw, Character, Created); });
		return;
	}
	TSharedPtr<FJsonObject> Agent = MakeShared<FJsonObject>();
	Agent->SetStringField(TEXT("name"), Name);
	Agent->SetObjectField(TEXT("position"), Place(Location));
	Agent->SetNumberField(TEXT("heading"), FMath::DegreesToRadians(FRotator::NormalizeAxis(Yaw)));
	if (!Character) return Create(Agent, Created);
	Call(TEXT("POST"), TEXT("/v1/bodies:fit"), Character, [this, Agent, Created](const FJsonObject& Fit) {
		Agent->SetStringField(TEXT("gender"), Fit.GetStringField(TEXT("gender")));
		Agent->SetArrayField(TEXT("betas"), Fit.GetArrayField(TEXT("betas")));
		Create(Agent, Created);
	});
}

void UWayfarerSubsystem::Create(const TSharedPtr<FJsonObject>& Agent, TFunction<void(const FString&)> Created)
{
	TSharedPtr<FJsonObject> Body = MakeShared<FJsonObject>();
	Body->SetArrayField(TEXT("agents"), {MakeShared<FJsonValueObject>(Agent)});
	const FString Path = TEXT("/v1/sessions/") + FGenericPlatformHttp::UrlEncode(SessionId) + TEXT("/agents");
	Call(TEXT("POST"), Path, Body, [Created](const FJsonObject& Answer) {
		for (const TSharedPtr<FJsonValue>& Each : Answer.GetArrayField(TEXT("agents")))
		{
			if (Created) Created(Each->AsObject()->GetStringField(TEXT("agent_id")));
		}
	});
}

void UWayfarerSubsystem::SetGoal(const FString& AgentId, const FVector& Location, double Speed)
{
	TSharedPtr<FJsonObject> Goal = MakeShared<FJsonObject>();
	Goal->SetObjectField(TEXT("position"), Place(Location));
	Goal->SetNumberField(TEXT("speed"), Speed);
	Call(TEXT("PUT"), AgentPath(AgentId, TEXT("/goal")), Goal, nullptr);
}

void UWayfarerSubsystem::Wander(const FString& AgentId)
{
	Call(TEXT("PUT"), AgentPath(AgentId, TEXT("/wander")), MakeShared<FJsonObject>(), nullptr);
}

void UWayfarerSubsystem::DeleteAgent(const FString& AgentId)
{
	Call(TEXT("DELETE"), AgentPath(AgentId, TEXT("")), nullptr, nullptr);
}

uint32 UWayfarerSubsystem::AliasOf(const FString& AgentId) const
{
	const uint32* Found = Aliases.Find(AgentId);
	return Found ? *Found : 0;
}

double UWayfarerSubsystem::Advance()
{
	if (Core && AdvancedIn != GFrameCounter)
	{
		AdvancedIn = GFrameCounter;
		Moment = wf_player_advance(Core, FPlatformTime::Seconds());
	}
	return Moment;
}

void UWayfarerSubsystem::Tick(float)
{
	const double Now = FPlatformTime::Seconds();
	if (Socket && Now - HeardAt > Silence) Lost(0, TEXT("nothing came for 2.5 s")); // a half-open connection never closes by itself
	if (!Socket && !SessionId.IsEmpty() && Now >= ConnectAt) Connect();
	if (Socket && bBegun && !Rings.IsEmpty() && Now - SaidAt >= 0.1)
	{
		const FString Wanted = Viewpoints();
		if (Wanted != Said)
		{
			Said = Wanted;
			SaidAt = Now;
			Socket->Send(Said);
		}
	}
	Advance();
}

namespace
{
	FString Whole(double Value)
	{
		return FString::FromInt(static_cast<int32>(Value));
	}

	FString Radius(double Centimetres)
	{
		return TEXT("{\"radius\":") + Whole(Centimetres);
	}
}

void UWayfarerSubsystem::SetRings(double Near, double Middle, double Far)
{
	const TCHAR* const Fewer = TEXT(",\"format\":{\"encoding\":\"smallest_three\",\"fps\":20,\"profile\":\"bones\",\"bones\":[\"pelvis\",\"left_hip\",\"right_hip\",\"left_knee\",\"right_knee\",\"spine1\",\"spine2\",\"spine3\",\"neck\",\"left_shoulder\",\"right_shoulder\",\"left_elbow\",\"right_elbow\"]}}");
	TArray<FString> Each;
	if (Near > 0) Each.Add(Radius(Near) + TEXT("}"));
	if (Middle > 0) Each.Add(Radius(Middle) + Fewer);
	if (Far > 0) Each.Add(Radius(Far) + TEXT(",\"format\":{\"encoding\":\"root\"}}"));
	Rings.Reset();
	for (const FString& Ring : Each)
	{
		if (!Rings.IsEmpty()) Rings += TEXT(",");
		Rings += Ring;
	}
}

void UWayfarerSubsystem::Look(const FVector& Location)
{
	View = Location;
}

FString UWayfarerSubsystem::Viewpoints() const
{
	return TEXT("{\"viewpoints\":[{\"position\":{\"x\":") + Whole(View.X) + TEXT(",\"y\":") + Whole(View.Y) + TEXT(",\"z\":") + Whole(View.Z) + TEXT("}}]}");
}

void UWayfarerSubsystem::Call(const FString& Verb, const FString& Path, const TSharedPtr<FJsonObject>& Body, TFunction<void(const FJsonObject&)> Answered)
{
	if (Homes) Send(RouteOf(Homes, Path), Verb, Path, Body, Answered);
}

void UWayfarerSubsystem::Send(const TSharedRef<wf_route>& Route, const FString& Verb, const FString& Path, const TSharedPtr<FJsonObject>& Body, TFunction<void(const FJsonObject&)> Answered)
{
	const FString To = UTF8_TO_TCHAR(wf_route_address(&Route.Get()));
	TSharedRef<IHttpRequest, ESPMode::ThreadSafe> Request = FHttpModule::Get().CreateRequest();
	Request->SetURL(To + Path);
	Request->SetVerb(Verb);
	Request->SetTimeout(10);
	Request->SetHeader(TEXT("Accept"), TEXT("application/json"));
	if (!Key.IsEmpty()) Request->SetHeader(TEXT("Authorization"), TEXT("Bearer ") + Key);
	if (Body)
	{
		FString Text;
		FJsonSerializer::Serialize(Body.ToSharedRef(), TJsonWriterFactory<>::Create(&Text));
		Request->SetHeader(TEXT("Content-Type"), TEXT("application/json"));
		Request->SetContentAsString(Text);
	}
	Request->OnProcessRequestComplete().BindWeakLambda(this, [this, Route, To, Verb, Path, Body, Answered, Asked = Opened](FHttpRequestPtr, FHttpResponsePtr Response, bool bConnected) {
		if (Asked != Opened) return; // of an earlier session
		TSharedPtr<FJsonObject> Answer;
		if (bConnected && Response) FJsonSerializer::Deserialize(TJsonReaderFactory<>::Create(Response->GetContentAsString()), Answer);
		const int32 Status = bConnected && Response ? Response->GetResponseCode() : 0;
		if (Status >= 200 && Status < 300)
		{
			wf_route_answered(&Route.Get(), TCHAR_TO_UTF8(*(Answer ? Made(*Answer) : FString())));
			if (Answered && Answer) Answered(*Answer);
			return;
		}
		if (GoesOn(&Route.Get(), Status, Answer)) return Send(Route, Verb, Path, Body, Answered);
		FString Why = Status ? FString::Printf(TEXT("HTTP %d"), Status) : To + TEXT(" does not answer");
		if (Answer) Answer->TryGetStringField(TEXT("detail"), Why);
		OnRefused.Broadcast(Verb + TEXT(" ") + Path, Why);
		if (SessionId.IsEmpty()) OnStatus.Broadcast(TEXT("ended"), Why);
	});
	Request->ProcessRequest();
}

void UWayfarerSubsystem::Connect()
{
	if (!bMoved) wf_route_begin(StreamRoute.Get());
	bMoved = false;
	FString Url = TEXT("ws") + FString(UTF8_TO_TCHAR(wf_route_address(StreamRoute.Get()))).RightChop(4) + TEXT("/v1/stream?encoding=smallest_three&session=") + FGenericPlatformHttp::UrlEncode(SessionId);
	const FString Token = UTF8_TO_TCHAR(wf_player_resume_token(Core));
	if (!Token.IsEmpty() && Token != Forgotten) Url += TEXT("&resume_token=") + FGenericPlatformHttp::UrlEncode(Token);
	TMap<FString, FString> Headers;
	if (!Key.IsEmpty()) Headers.Add(TEXT("Authorization"), TEXT("Bearer ") + Key);
	if (!Rings.IsEmpty())
	{
		Said = Viewpoints();
		Url += TEXT("&interest=") + FGenericPlatformHttp::UrlEncode(TEXT("{\"rings\":[") + Rings + TEXT("],") + Said.RightChop(1));
	}
	bBegun = false;
	wf_player_begin(Core);
	Message.Reset();
	HeardAt = FPlatformTime::Seconds();
	Socket = FWebSocketsModule::Get().CreateWebSocket(Url, TArray<FString>{TEXT("wayfarer.v1")}, Headers);
	Socket->OnRawMessage().AddUObject(this, &UWayfarerSubsystem::Receive);
	Socket->OnConnectionError().AddWeakLambda(this, [this](const FString& Error) { Lost(0, Error); });
	Socket->OnClosed().AddWeakLambda(this, [this](int32 Code, const FString& Reason, bool) { Lost(Code, Reason); });
	Socket->Connect();
}

void UWayfarerSubsystem::Receive(const void* Data, SIZE_T Size, SIZE_T BytesRemaining)
{
	HeardAt = FPlatformTime::Seconds();
	Message.Append(static_cast<const uint8*>(Data), static_cast<int32>(Size));
	if (BytesRemaining) return;
	const int32 Kind = wf_player_receive(Core, Message.GetData(), static_cast<size_t>(Message.Num()), HeardAt);
	Message.Reset(); // keeps its room
	if (Kind == WF_ERROR) End(FString(TEXT("cannot read the stream: ")) + UTF8_TO_TCHAR(wf_error()));
	else if (Kind == WF_HEADER)
	{
		Retry = RetryFirst;
		bBegun = true;
		wf_route_answered(StreamRoute.Get(), "");
		OnStatus.Broadcast(TEXT("open"), SessionId);
	}
}

void UWayfarerSubsystem::Lost(int32 Code, const FString& Reason)
{
	if (!Socket) return;
	DropSocket();
	const double Now = FPlatformTime::Seconds();
	const FString Token = UTF8_TO_TCHAR(wf_player_resume_token(Core));
	if (Code == Invalid && !Token.IsEmpty() && Token != Forgotten)
	{
		Forgotten = Token; // perhaps of another server: begin with the frames due next
		ConnectAt = Now;
	}
	else if (Code == Ended || Code == UnknownCaller || Code == Forbidden || Code == NotFound || Code == Invalid)
	{
		End(Reason);
	}
	else if (wf_route_closed(StreamRoute.Get(), Code, TCHAR_TO_UTF8(*Reason)))
	{
		bMoved = true;
		ConnectAt = Now;
	}
	else
	{
		OnStatus.Broadcast(TEXT("lost"), Reason);
		ConnectAt = Now + Retry;
		Retry = FMath::Min(RetryMost, 2 * Retry);
	}
}

void UWayfarerSubsystem::End(const FString& Reason)
{
	DropSocket();
	SessionId.Reset(); // the shown poses stay
	OnStatus.Broadcast(TEXT("ended"), Reason);
}

void UWayfarerSubsystem::DropSocket()
{
	if (!Socket) return;
	TSharedPtr<IWebSocket> Gone = MoveTemp(Socket);
	Socket.Reset();
	Gone->OnRawMessage().RemoveAll(this);
	Gone->OnConnectionError().RemoveAll(this);
	Gone->OnClosed().RemoveAll(this);
	Gone->Close();
}
