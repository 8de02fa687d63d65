#pragma once

#include "CoreMinimal.h"
#include "Subsystems/GameInstanceSubsystem.h"
#include "Tickable.h"
#include "WayfarerSubsystem.generated.h"

class FJsonObject;
class IWebSocket;
struct wf_homes;
struct wf_player;
struct wf_route;

DECLARE_DYNAMIC_MULTICAST_DELEGATE_TwoParams(FWayfarerStatus, const FString&, Status, const FString&, Detail);
DECLARE_DYNAMIC_MULTICAST_DELEGATE_TwoParams(FWayfarerAgent, const FString&, AgentId, const FString&, Name);
DECLARE_DYNAMIC_MULTICAST_DELEGATE_FourParams(FWayfarerEvent, const FString&, Kind, const FString&, AgentId, int32, Waypoint, const FString&, Detail);

/**
 * A session of a Wayfarer server: one per game instance. Game thread only. Places are the server's, in the basis
 * "unreal": centimetres in the world, with its origin.
 */
UCLASS()
class WAYFARER_API UWayfarerSubsystem : public UGameInstanceSubsystem, public FTickableGameObject
{
	GENERATED_BODY()

public:
	/**
	 * Open a session on "http://host:port". The command line's -WayfarerServer= and -WayfarerToken= take precedence.
	   Scene:
	 * the id of one; "": an endless floor.
	 */
	UFUNCTION(BlueprintCallable, Category = Wayfarer)
	void Open(FString Server = TEXT("http://localhost:8080"), FString Token = TEXT(""), const FString& Scene = TEXT(""));

	/** End the session, with its agents. */
	UFUNCTION(BlueprintCallable, Category = Wayfarer)
	void Close();

	/**
	 * Create an agent; Created receives its id once the server has answered. May be called before the session is open.
	 * Character: a request of POST /v1/bodies:fit, for an agent of a character's proportions; null: the mean body.
	 */
	void CreateAgent(const FString& Name, const FVector& Location, double Yaw, const TSharedPtr<FJsonObject>& Character, TFunction<void(const FString& AgentId)> Created);

	/** Send an agent to a place; Speed in centimetres per second. */
	UFUNCTION(BlueprintCallable, Category = Wayfarer)
	void SetGoal(const FString& AgentId, const FVector& Location, double Speed = 120);

	/** Make an agent wander all over its scene. */
	UFUNCTION(BlueprintCallable, Category = Wayfarer)
	void Wander(const FString& AgentId);

	UFUNCTION(BlueprintCallable, Category = Wayfarer)
	void DeleteAgent(const FString& AgentId);

	/**
	 * Before Open: levels of detail by distance from the viewpoint (see Look), in centimetres. Agents come in full within
	 * Near, with fewer frames and bones within Middle, and as a place, heading and gait within Far, shown as walking
	 * people. Beyond Far they are removed until they come nearer. A distance of 0 leaves its ring out.
	 */
	UFUNCTION(BlueprintCallable, Category = Wayfarer)
	void SetRings(double Near, double Middle, double Far);

	/** See the agents from here. Call it as often as the camera moves: ten calls a second at most are sent, and always the last. */
	UFUNCTION(BlueprintCallable, Category = Wayfarer)
	void Look(const FVector& Location);

	/** "opening", "open", "lost" (it retries), "ended" (it does not). */
	UPROPERTY(BlueprintAssignable, Category = Wayfarer)
	FWayfarerStatus OnStatus;
	/** The stream has introduced an agent, or it is gone. */
	UPROPERTY(BlueprintAssignable, Category = Wayfarer)
	FWayfarerAgent OnAgentAdded;
	UPROPERTY(BlueprintAssignable, Category = Wayfarer)
	FWayfarerAgent OnAgentRemoved;
	/** Kinds such as "goal_reached" and "path_done" (docs/wire-format.md, "Events"). */
	UPROPERTY(BlueprintAssignable, Category = Wayfarer)
	FWayfarerEvent OnEvent;
	/** A call was refused: "PUT /v1/agents/…" and why. */
	UPROPERTY(BlueprintAssignable, Category = Wayfarer)
	FWayfarerStatus OnRefused;

	/** Bring all agents to this moment, at the first call of a frame. Returns the moment: the server's clock, seconds. */
	double Advance();
	/** For the core's C ABI; null before Open. */
	const wf_player* Player() const { return Core; }
	/** The alias of an agent of the stream; 0: it has not come yet. */
	uint32 AliasOf(const FString& AgentId) const;

	/** Counts sessions: an alias means an agent of one of them. */
	uint32 Generation() const { return Opened; }

	virtual void Deinitialize() override;
	virtual void Tick(float DeltaTime) override;
	virtual bool IsTickable() const override { return Core != nullptr; }
	virtual TStatId GetStatId() const override;

private:
	void Create(const TSharedPtr<FJsonObject>& Agent, TFunction<void(const FString&)> Created);
	void Call(const FString& Verb, const FString& Path, const TSharedPtr<FJsonObject>& Body, TFunction<void(const FJsonObject&)> Answered);
	void Send(const TSharedRef<wf_route>& Route, const FString& Verb, const FString& Path, const TSharedPtr<FJsonObject>& Body, TFunction<void(const FJsonObject&)> Answered);
	void Connect();
	void Receive(const void* Data, SIZE_T Size, SIZE_T BytesRemaining);
	void Lost(int32 Code, const FString& Reason);
	void End(const FString& Reason);
	void DropSocket();

	FString Viewpoints() const;

	FString Address, Key, SessionId, Forgotten;
	FString Rings, Said; // rings of the query, as JSON; viewpoints known to the server
	FVector View = FVector(0, 0, 0);
	double SaidAt = 0;
	bool bBegun = false; // this connection's header has come
	TSharedPtr<IWebSocket> Socket;
	wf_homes* Homes = nullptr; // known nodes of a cluster
	TSharedPtr<wf_route> StreamRoute;
	bool bMoved = false; // the route says where to connect
	TArray<TFunction<void()>> WhenOpen;
	TArray<uint8> Message;
	TMap<FString, uint32> Aliases;
	wf_player* Core = nullptr;
	uint32 Opened = 0; // answers for an earlier one are dropped
	double Moment = 0, Retry = 0.5, ConnectAt = 0, HeardAt = 0;
	uint64 AdvancedIn = 0;
};
