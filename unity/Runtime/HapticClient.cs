// A client of one device: connects, sends commands, keeps the newest report. Two threads of its own read and write, so
// that no call waits for the network. Without Unity: any program in C# can use it.
using System;
using System.Collections.Generic;
using System.Net.Sockets;
using System.Security.Cryptography;
using System.Threading;

namespace Hapticd
{
    /// <summary>There is no such server or device.</summary>
    public sealed class ConnectException : Exception
    {
        public ConnectException(string text, Exception cause = null) : base(text, cause) {}
    }

    /// <summary>Every method may be called from any thread. Commands are sent at once, in the order of the calls; after
    /// the connection has ended they do nothing. Events are raised by Poll(), in its thread.</summary>
    public sealed class HapticClient : IDisposable
    {
        const int ReportsOfTicks = 16;        // a bit of `hapticd Subscribe`
        const int MostTicksKept = 4096;
        const int NumbersInMessage = 15000;   // of a part of a mesh
        const long StopBacklog_bytes = 65536;  // behind more, a stop takes a connection of its own
        const long MostQueued_bytes = 256 << 20;

        const string Force = "vrpn_ForceDevice ";
        const string Own = "hapticd ";
        const string Plain = "vrpn_Base ";
        static readonly string[] Types = {
            Force + "setObjectNumber", Force + "clearTrimesh", Force + "setHapticProperty", Force + "setTransformMatrix",
            Force + "setObjectIsTouchable", Force + "setTouchableFace", Force + "setWorkspaceBoundingBox",
            Force + "resetScene", Force + "Effect", Force + "startEffect", Force + "stopEffect",
            Own + "Query_Capabilities", Own + "Subscribe", Own + "Set_Object_Name", Own + "Mesh_Vertices",
            Own + "Mesh_Triangles", Own + "Batch_Begin", Own + "Batch_Commit", Own + "Identify", Own + "Stop_Forces",
            Own + "Rearm_Forces", Own + "Heartbeat", Own + "Marker", Own + "Hold_Hand", Plain + "ping_message",
        };

        readonly string host;
        readonly int port;
        readonly TcpClient tcp;
        readonly Peer peer;
        readonly object outgoing = new object();
        readonly Queue<byte[]> urgent = new Queue<byte[]>();  // overtakes the other queue
        readonly Queue<byte[]> queue = new Queue<byte[]>();
        readonly object incoming = new object();
        readonly Queue<TickReport> ticks = new Queue<TickReport>();
        readonly Queue<Action> events = new Queue<Action>();
        readonly ManualResetEvent heard = new ManualResetEvent(false);      // from the device
        readonly ManualResetEvent readToEnd = new ManualResetEvent(false);  // of the stream
        readonly long key = NewKey();
        long queued;  // bytes that are not written
        List<byte[]> batch;
        TickReport latest;
        bool hasTick;
        volatile Thread stopping;
        volatile bool disposing;
        volatile string ended;

        /// <summary>Name of the device.</summary>
        public string Device { get; private set; }
        /// <summary>Whether the connection stands; WhyEnded says why not.</summary>
        public bool Connected { get { return ended == null; } }
        public string WhyEnded { get { return ended ?? ""; } }

        /// <summary>A text of the server for people, such as the reason of a refusal.</summary>
        public event Action<Severity, string> TextReceived;
        /// <summary>Somebody marked a moment.</summary>
        public event Action<string> MarkerReceived;
        /// <summary>The connection has ended, and why.</summary>
        public event Action<string> Disconnected;

        /// <summary>Connects to "NAME@host" or "NAME@host:port", with or without "tcp://" before the host; always by TCP. Waits
        /// for an answer of the device. Throws ArgumentException for another form, ConnectException.</summary>
        /// <param name="server">for example "Phantom@192.168.1.20"</param>
        /// <param name="timeout_ms">for the connection, and again for the answer</param>
        /// <param name="rate_Hz">highest rate of tick reports; the server has a tick each millisecond</param>
        /// <param name="token">for servers that ask for one; empty: none</param>
        public HapticClient(string server, int timeout_ms = 3000, double rate_Hz = 200, string token = "")
        {
            string device;
            Parse(server, out device, out host, out port);
            Device = device;
            peer = new Peer(device, Types, Receive);
            tcp = Open(timeout_ms);
            Enqueue(urgent, peer.Opening());
            if (token != "") Identify(token);
            Send(Own + "Query_Capabilities", new Payload());  // servers that know the question send all kinds of reports
            Subscribe(rate_Hz);
            Send(Plain + "ping_message", new Payload());
            Start(Read, "hapticd-read");
            Start(Write, "hapticd-write");
            if (!heard.WaitOne(timeout_ms))
            {
                string why = ended ?? (peer.Connected
                    ? "the server has no device '" + device + "'; it has " + peer.Devices
                    : "no answer in " + timeout_ms + " ms: is this a VRPN server?");
                End(why);
                throw new ConnectException(server + ": " + why);
            }
        }

        /// <summary>Ends the connection when what was commanded is sent, which may take a second. The server then ends effects
        /// of this client and releases the simulated hand; the scene stays or goes as the server is configured.</summary>
        public void Dispose()
        {
            disposing = true;
            Flush(1000);
            try
            {
                if (Connected)
                {
                    tcp.Client.Shutdown(SocketShutdown.Send);
                    readToEnd.WaitOne(500);  // to close before would take from the server what it has not read
                }
            }
            catch (SocketException)
            {
                // It has ended meanwhile.
            }
            End("closed");
        }

        // --- reports

        /// <summary>Raises the events of what has arrived. Call it once per frame.</summary>
        public void Poll()
        {
            for (;;)
            {
                Action next;
                lock (incoming)
                {
                    if (events.Count == 0) return;
                    next = events.Dequeue();
                }
                next();
            }
        }

        /// <summary>The newest tick; false before the first.</summary>
        public bool TryGetTick(out TickReport tick)
        {
            lock (incoming)
            {
                tick = latest;
                return hasTick;
            }
        }

        /// <summary>All ticks since the last call, oldest first; at most the newest 4096.</summary>
        public TickReport[] TakeTicks()
        {
            lock (incoming)
            {
                TickReport[] taken = ticks.ToArray();
                ticks.Clear();
                return taken;
            }
        }

        /// <summary>Chooses the highest rate of ticks.</summary>
        public void Subscribe(double rate_Hz)
        {
            if (!(rate_Hz >= 0) || double.IsInfinity(rate_Hz))
                throw new ArgumentException("a report rate of " + rate_Hz + " Hz: give a number of at least 0");
            Send(Own + "Subscribe", new Payload().U32(ReportsOfTicks).F64(rate_Hz));
        }

        // --- the scene; object 0 always exists

        /// <summary>Makes the scene have at least this many objects.</summary>
        public void SetObjectCount(int count) { Send(Force + "setObjectNumber", new Payload().I32(count)); }

        /// <summary>Names an object, for the viewer and for recordings; at most 64 bytes of UTF-8.</summary>
        public void SetObjectName(int obj, string name)
        {
            Send(Own + "Set_Object_Name", new Payload().I32(obj).Text(name, 64, false, "the name"));
        }

        /// <summary>Sets the mesh of an object, in one tick: x y z of each vertex, and three vertex numbers for each triangle,
        /// counter-clockwise seen from the front. Throws ArgumentException for lists of another length, numbers outside the
        /// vertices and coordinates that are not finite.</summary>
        public void SetMesh(int obj, float[] vertices_mm, int[] triangles)
        {
            CheckVertices(vertices_mm);  // also of a mesh without triangles
            CheckTriangles(triangles, vertices_mm.Length / 3);
            Batch(() =>
            {
                Send(Force + "clearTrimesh", new Payload().I32(obj));
                if (triangles.Length == 0) return;  // the server takes vertices alone for a list of corners
                SetVertices(obj, 0, vertices_mm);
                for (int at = 0; at < triangles.Length; at += NumbersInMessage)
                {
                    int count = Math.Min(NumbersInMessage, triangles.Length - at);
                    Payload part = new Payload().I32(obj).I32(at / 3).I32(count);
                    for (int i = 0; i < count; ++i) part.I32(triangles[at + i]);
                    Send(Own + "Mesh_Triangles", part);
                }
            });
        }

        /// <summary>Moves vertices from number `first` on, for meshes that deform: x y z of each. Throws ArgumentException for
        /// a list of another length and coordinates that are not finite.</summary>
        public void SetVertices(int obj, int first, float[] vertices_mm)
        {
            CheckVertices(vertices_mm);
            for (int at = 0; at < vertices_mm.Length; at += NumbersInMessage)
            {
                int count = Math.Min(NumbersInMessage, vertices_mm.Length - at);
                Payload part = new Payload().I32(obj).I32(first + at / 3).I32(count);
                for (int i = 0; i < count; ++i) part.F32(vertices_mm[at + i]);
                Send(Own + "Mesh_Vertices", part);
            }
        }

        /// <summary>Waits until all commands are handed to the system; false when that takes longer.</summary>
        public bool Flush(int timeout_ms)
        {
            DateTime until = DateTime.UtcNow.AddMilliseconds(timeout_ms);
            lock (outgoing)
            {
                while (queued > 0 && ended == null)
                {
                    TimeSpan left = until - DateTime.UtcNow;
                    if (left <= TimeSpan.Zero || !Monitor.Wait(outgoing, left)) return queued == 0;
                }
                return queued == 0;
            }
        }

        /// <summary>Sets how an object feels.</summary>
        public void SetSurface(int obj, Surface surface)
        {
            SetProperty(obj, "stiffness", surface.Stiffness);
            SetProperty(obj, "damping", surface.Damping);
            SetProperty(obj, "static friction", surface.StaticFriction);
            SetProperty(obj, "dynamic friction", surface.DynamicFriction);
            SetProperty(obj, "popthrough", surface.Popthrough);
        }

        /// <summary>Places an object: 16 numbers column by column, the translation in 12 to 14, in mm. At any rate: the hand
        /// feels the object move.</summary>
        public void SetTransform(int obj, double[] columns)
        {
            if (columns.Length != 16) throw new ArgumentException("a matrix of " + columns.Length + " numbers: give 16");
            Payload payload = new Payload().I32(obj);
            foreach (double number in columns) payload.F64(number);
            Send(Force + "setTransformMatrix", payload);
        }

        /// <summary>Starts or stops rendering an object.</summary>
        public void SetTouchable(int obj, bool touchable)
        {
            Send(Force + "setObjectIsTouchable", new Payload().I32(obj).I16(touchable ? 1 : 0));
        }

        /// <summary>Chooses the sides of all objects; both at first.</summary>
        public void SetTouchableFaces(Faces faces) { Send(Force + "setTouchableFace", new Payload().I32((int)faces)); }

        /// <summary>Fits the device's workspace to a box of the world.</summary>
        public void SetWorkspaceBox(Triple min_mm, Triple max_mm)
        {
            Payload payload = new Payload();
            for (int i = 0; i < 16; ++i) payload.F64(i % 5 == 0 ? 1 : 0);
            Send(Force + "setWorkspaceBoundingBox", payload.F64(min_mm).F64(max_mm));
        }

        /// <summary>Removes all meshes and effects, and resets the workspace.</summary>
        public void ResetScene() { Send(Force + "resetScene", new Payload().Text("", 1, false, "")); }

        /// <summary>What `commands` sends takes effect in one tick. Nothing is sent when it throws. A batch within
        /// a batch is part of it.</summary>
        public void Batch(Action commands)
        {
            lock (outgoing)
            {
                if (batch != null)
                {
                    commands();
                    return;
                }
                batch = new List<byte[]>();
                try
                {
                    Send(Own + "Batch_Begin", new Payload());
                    commands();
                    Send(Own + "Batch_Commit", new Payload());
                    foreach (byte[] frame in batch) Enqueue(queue, frame);
                }
                finally
                {
                    batch = null;
                }
            }
        }

        // --- effects, by number, up to 64; they end when this client leaves

        /// <summary>A force of this magnitude in this direction.</summary>
        public void SetConstantForce(int index, Triple direction, double magnitude_N, double duration_ms = 0)
        {
            SetEffect("constant", index, 0, magnitude_N, duration_ms, 0, new Triple(), direction);
        }
        /// <summary>A pull to a position that grows with the distance up to the magnitude.</summary>
        public void SetSpring(int index, Triple position_mm, double gain_N_per_mm, double magnitude_N)
        {
            SetEffect("spring", index, gain_N_per_mm, magnitude_N, 0, 0, position_mm, new Triple());
        }
        /// <summary>A force against the motion that grows with the speed up to the magnitude.</summary>
        public void SetViscosity(int index, double gain_N_s_per_mm, double magnitude_N)
        {
            SetEffect("viscous", index, gain_N_s_per_mm, magnitude_N, 0, 0, new Triple(), new Triple());
        }
        /// <summary>A vibration of the device until it is stopped.</summary>
        public void SetVibration(int index, double frequency_Hz, double magnitude_N)
        {
            SetEffect("vibrationMotor", index, 0, magnitude_N, 0, frequency_Hz, new Triple(), new Triple());
        }
        public void StartEffect(int index) { Send(Force + "startEffect", new Payload().I32(index)); }
        public void StopEffect(int index) { Send(Force + "stopEffect", new Payload().I32(index)); }

        // --- control

        /// <summary>Brings the force of the device to zero within one tick of its arrival, until RearmForces(). It overtakes
        /// what waits here; behind much that the network has, it takes a connection of its own.</summary>
        public void StopForces()
        {
            Identify("");
            Send(Own + "Stop_Forces", new Payload(), true);
            bool behind;
            lock (outgoing) behind = queued > StopBacklog_bytes;
            if (behind) stopping = Start(StopBeside, "hapticd-stop");
        }

        /// <summary>Clears a stop and latched trips; forces return over 0.5 s. A stop that is under way on its own connection is
        /// waited for, up to two seconds.</summary>
        public void RearmForces()
        {
            Thread stop = stopping;
            if (stop != null) stop.Join();
            Identify("");
            Send(Own + "Rearm_Forces", new Payload());
        }

        /// <summary>From the first call on, the server takes a client that sends none for 500 ms for lost, and ends its forces.
        /// Call it every 100 ms; `watch` false ends that.</summary>
        public void Heartbeat(bool watch = true) { Send(Own + "Heartbeat", new Payload().I16(watch ? 1 : 0), true); }

        /// <summary>Marks a moment in the recording of the server, and for all clients; at most 255 bytes of UTF-8.</summary>
        public void Mark(string text) { Send(Own + "Marker", new Payload().I64(0).Text(text, 256, true, "the marker")); }

        /// <summary>Moves the simulated hand, if the device is one.</summary>
        public void HoldHand(Triple position_mm, Rotation orientation, uint buttons = 0)
        {
            Send(Own + "Hold_Hand", new Payload().I16(1).F64(position_mm).F64(orientation).U32(buttons));
        }
        public void ReleaseHand()
        {
            Send(Own + "Hold_Hand", new Payload().I16(0).F64(new Triple()).F64(Rotation.Identity).U32(0));
        }

        // --- below

        void SetProperty(int obj, string name, float value)
        {
            Send(Force + "setHapticProperty", new Payload().I32(obj).Text(name, 20, false, "the property").F32(value));
        }

        void SetEffect(string type, int index, double gain, double magnitude_N, double duration_ms, double frequency,
                       Triple position_mm, Triple direction)
        {
            Send(Force + "Effect", new Payload()
                                       .Text(type, 20, false, "the type")
                                       .I32(index)
                                       .F64(gain)
                                       .F64(magnitude_N)
                                       .F64(duration_ms)
                                       .F64(frequency)
                                       .F64(position_mm)
                                       .F64(direction));
        }

        // The key tells the server that connections are one program.
        void Identify(string token)
        {
            Send(Own + "Identify", new Payload().Text(token, 128, true, "the token").I64(key), true);
        }

        void Send(string type, Payload payload, bool first = false)
        {
            lock (outgoing)
            {
                byte[] frame = peer.Message(type, payload.ToArray());
                if (first) Enqueue(urgent, frame);
                else if (batch != null) batch.Add(frame);
                else Enqueue(queue, frame);
            }
        }

        void Enqueue(Queue<byte[]> to, byte[] frame)
        {
            lock (outgoing)
            {
                if (ended != null) return;
                to.Enqueue(frame);
                queued += frame.Length;
                if (queued > MostQueued_bytes) End("the server does not read: " + queued + " bytes wait for it");
                Monitor.PulseAll(outgoing);
            }
        }

        void Write()
        {
            NetworkStream stream = tcp.GetStream();
            for (;;)
            {
                byte[] frame;
                lock (outgoing)
                {
                    while (queued == 0 && ended == null) Monitor.Wait(outgoing);
                    if (ended != null) return;
                    frame = urgent.Count > 0 ? urgent.Dequeue() : queue.Dequeue();
                }
                stream.Write(frame, 0, frame.Length);
                lock (outgoing)
                {
                    queued -= frame.Length;
                    if (queued == 0) Monitor.PulseAll(outgoing);
                }
            }
        }

        void Read()
        {
            NetworkStream stream = tcp.GetStream();
            byte[] bytes = new byte[65536];
            for (;;)
            {
                int size = stream.Read(bytes, 0, bytes.Length);
                if (size == 0) break;
                peer.Feed(bytes, size);
            }
            readToEnd.Set();
            if (!disposing) End("closed by the server");
        }

        void Receive(string type, PayloadReader payload)
        {
            heard.Set();
            switch (type)
            {
                case Own + "Tick": Keep(ReadTick(payload)); break;
                case Plain + "text_message":
                {
                    Severity severity = (Severity)payload.U32();
                    payload.U32();  // level
                    string text = payload.Text(1024);
                    Post(() => Raise(TextReceived, severity, text));
                    break;
                }
                case Own + "Marker":
                {
                    payload.I64();  // time
                    string text = payload.Text(256);
                    Post(() => { if (MarkerReceived != null) MarkerReceived(text); });
                    break;
                }
            }
        }

        static TickReport ReadTick(PayloadReader payload)
        {
            return new TickReport {
                Tick = (ulong)payload.I64(),
                Time_ns = payload.I64(),
                Revision = (ulong)payload.I64(),
                Hand_m = payload.Triple(),
                Proxy_m = payload.Triple(),
                Velocity_m_per_s = payload.Triple(),
                Orientation = payload.Rotation(),
                Force_N = payload.Triple(),
                Depth_m = payload.F64(),
                Object = payload.I32(),
                Buttons = payload.U32(),
                GuardActive = payload.U32(),
                GuardLatched = payload.U32(),
            };
        }

        void Keep(TickReport tick)
        {
            lock (incoming)
            {
                latest = tick;
                hasTick = true;
                if (ticks.Count == MostTicksKept) ticks.Dequeue();
                ticks.Enqueue(tick);
            }
        }

        void Post(Action raise)
        {
            lock (incoming) events.Enqueue(raise);
        }

        static void Raise(Action<Severity, string> handlers, Severity severity, string text)
        {
            if (handlers != null) handlers(severity, text);
        }

        void End(string why)
        {
            lock (outgoing)
            {
                if (ended != null) return;
                ended = why;
                Monitor.PulseAll(outgoing);
            }
            tcp.Close();
            Post(() => { if (Disconnected != null) Disconnected(why); });
        }

        Thread Start(Action body, string name)
        {
            Thread thread = new Thread(() =>
            {
                try
                {
                    body();
                }
                catch (Exception error)
                {
                    End(error.Message);
                }
            });
            thread.Name = name;
            thread.IsBackground = true;
            thread.Start();
            return thread;
        }

        TcpClient Open(int timeout_ms)
        {
            TcpClient client = new TcpClient(AddressFamily.InterNetwork) { NoDelay = true };
            try
            {
                IAsyncResult attempt = client.BeginConnect(host, port, null, null);
                if (!attempt.AsyncWaitHandle.WaitOne(timeout_ms))
                    throw new ConnectException("no answer in " + timeout_ms + " ms");
                client.EndConnect(attempt);
                return client;
            }
            catch (Exception error)
            {
                client.Close();
                throw new ConnectException("no server at " + host + ":" + port + ": " + error.Message +
                                           ". Start one with 'hapticd serve', and let it listen to this machine", error);
            }
        }

        // The key makes the server take both connections for one program, which may then re-arm.
        void StopBeside()
        {
            bool done = false;
            Peer second = new Peer(Device, Types, (type, payload) => done |= type == Plain + "pong_message");
            try
            {
                using (TcpClient beside = Open(1000))
                {
                    NetworkStream stream = beside.GetStream();
                    stream.ReadTimeout = 1000;
                    byte[] identity = new Payload().Text("", 128, true, "").I64(key).ToArray();
                    foreach (byte[] part in new[] { second.Opening(), second.Message(Own + "Identify", identity),
                                                    second.Message(Own + "Stop_Forces", new byte[0]),
                                                    second.Message(Plain + "ping_message", new byte[0]) })
                        stream.Write(part, 0, part.Length);
                    byte[] bytes = new byte[4096];
                    for (int size; !done && (size = stream.Read(bytes, 0, bytes.Length)) > 0;) second.Feed(bytes, size);
                }
            }
            catch (Exception error)
            {
                Post(() => Raise(TextReceived, Severity.Error, "a stop by a second connection: " + error.Message));
            }
        }

        // The server ends the connection of a client that sends part of a vertex.
        static void CheckVertices(float[] vertices_mm)
        {
            if (vertices_mm.Length % 3 != 0)
                throw new ArgumentException(vertices_mm.Length + " coordinates: give x, y and z of each vertex");
            for (int i = 0; i < vertices_mm.Length; ++i)
            {
                if (float.IsNaN(vertices_mm[i]) || float.IsInfinity(vertices_mm[i]))
                    throw new ArgumentException("vertex " + i / 3 + " is not finite");
            }
        }

        static void CheckTriangles(int[] triangles, int vertices)
        {
            if (triangles.Length % 3 != 0)
                throw new ArgumentException(triangles.Length + " vertex numbers: give three for each triangle");
            foreach (int vertex in triangles)
            {
                if (vertex < 0 || vertex >= vertices)
                    throw new ArgumentException("a triangle with vertex " + vertex + ": there are " + vertices);
            }
        }

        static void Parse(string server, out string device, out string host, out int port)
        {
            int at = server.IndexOf('@');
            string rest = at > 0 ? server.Substring(at + 1) : "";
            if (rest.StartsWith("tcp://", StringComparison.Ordinal)) rest = rest.Substring(6);
            int colon = rest.IndexOf(':');
            device = at > 0 ? server.Substring(0, at) : "";
            host = colon < 0 ? rest : rest.Substring(0, colon);
            port = Peer.DefaultPort;
            bool isPort = colon < 0 || (int.TryParse(rest.Substring(colon + 1), out port) && port > 0 && port < 65536);
            if (host == "" || !isPort)
                throw new ArgumentException("server '" + server + "': expected NAME@host or NAME@host:port");
        }

        static long NewKey()
        {
            byte[] random = new byte[8];
            using (RandomNumberGenerator generator = RandomNumberGenerator.Create()) generator.GetBytes(random);
            return BitConverter.ToInt64(random, 0) | 1;  // 0 is none
        }
    }
}
