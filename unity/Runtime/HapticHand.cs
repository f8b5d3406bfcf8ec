// A haptic device in a Unity scene. Put it on a GameObject: where that is, the device has its origin, x to the right, y up
// and z away from the user.
using System.Collections.Generic;
using System.Threading;
using UnityEngine;

namespace Hapticd
{
    [AddComponentMenu("Haptics/Haptic Hand")]
    public sealed class HapticHand : MonoBehaviour
    {
        const float Retry_s = 1;
        const float HeartbeatEvery_s = 0.1f;

        [Tooltip("NAME@host or NAME@host:port of a server that runs 'hapticd serve'")]
        public string server = "Phantom@localhost";
        [Tooltip("For servers that ask for one")]
        public string token = "";
        [Tooltip("Metres of the scene that one metre of the device is")]
        public float scale = 1;
        [Tooltip("Moved to the proxy: where the hand would be if surfaces were hard. Optional")]
        public Transform proxy;
        [Tooltip("Moved to the device itself, which is inside of what it presses. Optional")]
        public Transform device;
        [Tooltip("Forces end when no frame was rendered for half a second, as at a breakpoint or while a scene loads")]
        public bool watchFrames;

        readonly List<HapticObject> objects = new List<HapticObject>();
        HapticClient client;
        Thread connecting;
        volatile HapticClient connected;  // by the other thread
        volatile string failure;
        string lastFailure;
        float nextAttempt;
        float nextHeartbeat;
        TickReport tick;

        /// <summary>The newest state of the hand, in the device's frame.</summary>
        public TickReport Tick { get { return tick; } }
        public bool IsConnected { get { return client != null && client.Connected; } }
        /// <summary>For commands that this component does not have; null while there is no connection.</summary>
        public HapticClient Client { get { return IsConnected ? client : null; } }
        /// <summary>On the hand, in the scene's frame, newtons.</summary>
        public Vector3 Force { get { return transform.rotation * DeviceFrame.ToUnity(tick.Force_N); } }
        /// <summary>The touched object; null: none.</summary>
        public HapticObject Touched
        {
            get { return tick.Object >= 0 && tick.Object < objects.Count ? objects[tick.Object] : null; }
        }

        /// <summary>Brings the force to zero until RearmForces().</summary>
        public void StopForces() { if (IsConnected) client.StopForces(); }
        public void RearmForces() { if (IsConnected) client.RearmForces(); }

        internal void Add(HapticObject obj)
        {
            int free = objects.IndexOf(null);
            if (free < 0)
            {
                free = objects.Count;
                objects.Add(null);
            }
            objects[free] = obj;
            obj.Number = free;
            if (IsConnected) obj.Upload(client);
        }

        internal void Remove(HapticObject obj)
        {
            objects[obj.Number] = null;
            if (IsConnected) client.SetTouchable(obj.Number, false);
        }

        void Update()
        {
            if (!IsConnected) Connect();
            if (client == null) return;
            client.Poll();
            if (!IsConnected) return;
            if (watchFrames && Time.unscaledTime >= nextHeartbeat)
            {
                client.Heartbeat();
                nextHeartbeat = Time.unscaledTime + HeartbeatEvery_s;
            }
            if (client.TryGetTick(out tick))
            {
                Place(proxy, tick.Proxy_m);
                Place(device, tick.Hand_m);
            }
            foreach (HapticObject obj in objects)
            {
                if (obj != null) obj.Follow(client);
            }
        }

        // In a thread of its own: a server that does not answer must not hold up frames.
        void Connect()
        {
            if (connecting == null && Time.unscaledTime >= nextAttempt)
            {
                nextAttempt = Time.unscaledTime + Retry_s;
                string to = server, with = token;
                connecting = new Thread(() => Open(to, with)) { IsBackground = true, Name = "hapticd-connect" };
                connecting.Start();
            }
            if (connecting == null || connecting.IsAlive) return;
            connecting = null;
            if (failure != null && failure != lastFailure) Debug.LogWarning("hapticd: " + failure, this);
            lastFailure = failure;
            if (connected == null) return;
            client = connected;
            connected = null;
            client.TextReceived += Log;
            client.Disconnected += why => Debug.LogWarning("hapticd: " + server + ": " + why, this);
            foreach (HapticObject obj in objects)
            {
                if (obj != null) obj.Upload(client);
            }
        }

        void Open(string to, string with)
        {
            failure = null;
            try
            {
                connected = new HapticClient(to, token: with);
            }
            catch (System.Exception error)
            {
                failure = error.Message;
            }
        }

        void Log(Severity severity, string text)
        {
            if (severity == Severity.Normal) Debug.Log("hapticd: " + text, this);
            else Debug.LogWarning("hapticd: " + text, this);
        }

        void Place(Transform part, Triple position_m)
        {
            if (part == null) return;
            part.position = transform.position + transform.rotation * (scale * DeviceFrame.ToUnity(position_m));
            part.rotation = transform.rotation * DeviceFrame.ToUnity(tick.Orientation);
        }

        // The editor keeps threads of a scene that was stopped.
        void OnDisable()
        {
            if (connecting != null) connecting.Join();
            connecting = null;
            if (connected != null) connected.Dispose();
            connected = null;
            if (client != null) client.Dispose();
            client = null;
            tick = new TickReport();
        }
    }
}
